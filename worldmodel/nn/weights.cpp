#include "worldmodel/nn/weights.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <span>
#include <sstream>

#include "worldmodel/nn/model_sizes.h"
#include "worldmodel/nn/weight_keys.h"

namespace evac::nn {
namespace {

/// How far a number may be from the float it was rounded from.
double RoundingOf(TensorType type) {
  if (type == TensorType::kBF16) return 0.01;
  return type == TensorType::kF16 ? 1e-3 : 1e-5;
}

/// @throws TensorError if one of the buffer's numbers is another in the file.
void RequireSame(const MappedTensors& tensors, const NoiseSchedule::Buffer& ours) {
  const TensorFile& file = tensors.file();
  const Tensor theirs = tensors.Get(ours.key).to(at::kFloat).contiguous();
  const float* found = theirs.data_ptr<float>();
  for (std::size_t t = 0; t < ours.values.size(); ++t) {
    if (std::abs(found[t] - ours.values[t]) <= RoundingOf(file.Get(ours.key).type)) continue;
    throw TensorError(file.name() + ": the schedule is another than the configuration's: " + ours.key + "[" +
                      std::to_string(t) + "] is " + std::to_string(found[t]) + ", wanted " +
                      std::to_string(ours.values[t]));
  }
}

constexpr const char* kNotInShapes[] = {
    "fps",                         "domain",
    "schedule.from_last_frame",    "schedule.carry_plane_m",
    "unet.num_head_channels",      "unet.init_attention_heads",
    "vae.scale_factor",            "action_resampler.heads",
    "image_resampler.heads",       "image_encoder.head_width"};
/// Likewise, of how a network is run: a file that is copied is not asked.
constexpr const char* kOfARun[] = {"chunk", "memory", "image_height_px", "image_width_px", "schedule.carry_frames"};

bool IsIn(std::span<const char* const> keys, const std::string& key) {
  return std::ranges::find(keys, key) != keys.end();
}

}  // namespace

/// Of the buffers two are asked: how much noise there is, which decides the others, and what clean latents are scaled
/// by (noise_schedule.h).
std::string CompareSchedule(const MappedTensors& tensors, const ModelConfig& config) {
  const std::int64_t last = config.schedule.steps - 1;
  const double end = tensors.Get("alphas_cumprod").to(at::kFloat)[last].item<double>();
  const bool is_put_aside = config.schedule.zero_terminal_snr && end != 0;
  for (const NoiseSchedule::Buffer& ours : NoiseSchedule(config.schedule).Buffers()) {
    const std::string key = ours.key;
    if ((key == "alphas_cumprod" && !is_put_aside) || key == "scale_arr") RequireSame(tensors, ours);
  }
  if (!is_put_aside) return {};
  return tensors.file().name() + ": the schedule does not end in pure noise (alphas_cumprod[" + std::to_string(last) +
         "] is " + std::to_string(end) + ", wanted 0): the configuration's is used";
}

std::string SizesNobodySees(const ModelConfig& config) {
  ModelConfig sizes = config;
  std::string text;
  for (const Size& size : SizesOf(sizes)) {
    if (IsIn(kNotInShapes, size.Key()) || IsIn(kOfARun, size.Key()))
      text += size.Key() + " " + TextOf(size) + "\n";
  }
  return text;
}

void CompareSizes(const TensorFile& file, const ModelConfig& config, const std::vector<std::string>& only) {
  const auto card = file.metadata().find("sizes");
  if (card == file.metadata().end()) return;
  ModelConfig sizes = config;
  const std::vector<Size> wanted = SizesOf(sizes);
  std::istringstream lines(card->second);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t space = std::min(line.find(' '), line.size());
    const std::string key = line.substr(0, space), found = line.substr(std::min(space + 1, line.size()));
    const auto begins = [&](const std::string& prefix) { return key.starts_with(prefix); };
    if (!only.empty() && std::ranges::none_of(only, begins)) continue;
    for (const Size& size : wanted) {
      if (size.Key() != key || TextOf(size) == found) continue;
      const auto shown = [](const std::string& text) { return text.empty() ? "none" : text; };
      throw TensorError(file.name() + ": was trained with " + key + " " + shown(found) + ", the page of sizes says " +
                        shown(TextOf(size)));
    }
  }
}

FileWeights::FileWeights(const std::filesystem::path& path, const ModelConfig& config, const LoadOptions& options)
    : tensors_(TensorFile::OpenCheckpoint(path)), options_(options) {
  KeyFit fit = CompareKeys(file(), config);
  if (!fit.Fits()) throw TensorError(file().name() + " does not fit the configuration: " + fit.Complaint());
  std::vector<std::string> asked;
  if (!options.is_run) asked.assign(std::begin(kNotInShapes), std::end(kNotInShapes));
  CompareSizes(file(), config, asked);
  report_ = {std::move(fit.unread), CompareSchedule(tensors_, config)};
  std::sort(report_.ignored_keys.begin(), report_.ignored_keys.end());
}

Tensor FileWeights::Take(const std::string& key, at::IntArrayRef shape) {
  const auto& ignored = report_.ignored_keys;
  const bool is_unread = !Has(key) || std::binary_search(ignored.begin(), ignored.end(), key);
  if (is_unread && (!options_.with_unread || !Has(key))) return {};
  const Tensor mapped = tensors_.Get(key);
  if (!is_unread) CheckShape(file().name() + ": " + key, mapped, shape);
  const Tensor tensor = InType(file().name() + ": " + key, mapped, options_.dtype).to(options_.device);
  if (!tensor.is_same(mapped)) LetGo(mapped);
  return tensor;
}

EvacModel LoadModel(const std::filesystem::path& weights, const ModelConfig& config, const LoadOptions& options,
                    LoadReport* report) {
  config.Check();
  FileWeights source(weights, config, options);
  if (report != nullptr) *report = source.report();
  return EvacModel(source, config);
}

}  // namespace evac::nn
