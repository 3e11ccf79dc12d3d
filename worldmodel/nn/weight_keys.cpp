#include "worldmodel/nn/weight_keys.h"

#include <algorithm>

namespace evac::nn {
namespace {

constexpr std::size_t kNamedAtMost = 10;

bool IsFloating(TensorType type) {
  return type == TensorType::kF16 || type == TensorType::kBF16 || type == TensorType::kF32 || type == TensorType::kF64;
}

/// "….attn2." of every attention to the context, with the place of its transformer among all of them.
struct ContextAttention {
  std::string prefix;
  std::size_t transformer;
};

std::vector<ContextAttention> ContextAttentions(const std::vector<ParameterShape>& keys) {
  static const std::string kMark = "to_k_ip.weight", kLayers = ".transformer_blocks.";
  std::vector<ContextAttention> found;
  std::string transformer;
  std::size_t count = 0;
  for (const ParameterShape& key : keys) {
    if (!key.key.ends_with(kMark)) continue;
    const std::string of = key.key.substr(0, key.key.find(kLayers));
    if (of != transformer) ++count;
    transformer = of;
    found.push_back({key.key.substr(0, key.key.size() - kMark.size()), count - 1});
  }
  return found;
}

void Say(std::string& text, const std::vector<std::string>& list, const char* one, const char* many) {
  if (list.empty()) return;
  text += (text.empty() ? "" : "; ") + std::to_string(list.size()) + (list.size() == 1 ? one : many);
  for (std::size_t i = 0; i < std::min(list.size(), kNamedAtMost); ++i) text += (i ? ", " : ": ") + list[i];
  if (list.size() > kNamedAtMost) text += ", …";
}

}  // namespace

std::set<std::string> DeadKeys(const std::vector<ParameterShape>& keys) {
  std::set<std::string> dead;
  for (const auto& [prefix, transformer] : ContextAttentions(keys)) {
    const char* unheard = transformer % 2 == 0 ? "_ip" : "_tp";  // actions first, then image, and so on
    for (const char* which : {"to_k", "to_v"}) {
      dead.insert(prefix + which + ".weight");
      dead.insert(prefix + which + unheard + ".weight");
    }
  }
  return dead;
}

bool IsClipLeftover(const std::string& key) {
  static const std::string kTower = "embedder.model.visual.";
  if (key.starts_with(kTower)) return key == kTower + "proj" || key.starts_with(kTower + "ln_post.");
  return key.starts_with("embedder.");
}

std::string KeyFit::Complaint() const {
  std::string text;
  Say(text, missing, " key is missing", " keys are missing");
  Say(text, extra, " key is not the network's", " keys are not the network's");
  Say(text, misshapen, " key does not fit", " keys do not fit");
  return text;
}

KeyFit CompareKeys(const TensorFile& file, const ModelConfig& config) {
  const std::vector<ParameterShape> keys = CheckpointKeys(config);
  const std::set<std::string> dead = DeadKeys(keys);
  std::set<std::string> wanted;
  KeyFit fit;
  for (const auto& [key, shape] : keys) {
    wanted.insert(key);
    const bool is_leftover = IsClipLeftover(key), is_unread = is_leftover || dead.contains(key);
    if (!file.Has(key)) {
      if (!is_unread) fit.missing.push_back(key);
      continue;
    }
    const TensorView& found = file.Get(key);
    if (is_unread) fit.unread.push_back(key);
    if (!is_leftover && (found.shape != shape || !IsFloating(found.type)))
      fit.misshapen.push_back(key + " is " + Name(found.type) + " " + ShapeText(found.shape) + ", wanted floats " +
                              ShapeText(shape));
  }
  for (const TensorView& tensor : file.tensors()) {
    if (wanted.contains(tensor.name)) continue;
    (IsClipLeftover(tensor.name) ? fit.unread : fit.extra).push_back(tensor.name);
  }
  return fit;
}

}  // namespace evac::nn
