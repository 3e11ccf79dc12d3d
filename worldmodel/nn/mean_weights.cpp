#include "worldmodel/nn/mean_weights.h"

#include <optional>
#include <set>

namespace evac::nn {
namespace {

const std::set<std::string> kOfEach = {"recipe", "seed", "steps"};
constexpr const char* kWhatFor[] = {"period_s", "cameras", "arms", "arms_read", "pose_map", "statistics"};

/// What all files say under a name; nothing where they differ or one says nothing.
std::optional<std::string> InCommon(const std::vector<std::unique_ptr<FileWeights>>& files, const std::string& name) {
  const TensorMetadata& first = files.front()->file().metadata();
  const auto wanted = first.find(name);
  if (wanted == first.end()) return std::nullopt;
  for (const auto& each : files) {
    const TensorMetadata& metadata = each->file().metadata();
    const auto found = metadata.find(name);
    if (found == metadata.end() || found->second != wanted->second) return std::nullopt;
  }
  return wanted->second;
}

/// What those say that say it; empty: none does. @throws TensorError if two say different things
std::string WhatAllSay(const std::vector<std::unique_ptr<FileWeights>>& files, const std::string& name) {
  const TensorFile* first = nullptr;
  for (const auto& each : files) {
    const TensorFile& file = each->file();
    const auto found = file.metadata().find(name);
    if (found == file.metadata().end()) continue;
    if (first == nullptr) first = &file;
    const std::string& wanted = first->metadata().at(name);
    if (found->second != wanted)
      throw TensorError("the mean of weights: " + name + " is '" + wanted + "' in " + first->name() + " and '" +
                        found->second + "' in " + file.name() + ": they were trained for different things");
  }
  return first == nullptr ? "" : first->metadata().at(name);
}

}  // namespace

MeanWeights::MeanWeights(const std::vector<std::filesystem::path>& paths, const ModelConfig& config) {
  if (paths.size() < 2)
    throw TensorError("the mean of weights: found " + std::to_string(paths.size()) + " file, wanted at least two");
  for (const auto& path : paths) files_.push_back(std::make_unique<FileWeights>(path, config));
  bool any_codec = false;
  for (const auto& each : files_) any_codec = any_codec || each->file().metadata().contains("codec");
  if (any_codec && !InCommon(files_, "codec"))
    throw TensorError("the mean of weights: their cards name different codecs, or only some name one: latents would mean different things");
  for (const char* key : kWhatFor) WhatAllSay(files_, key);
}

Tensor MeanWeights::Take(const std::string& key, at::IntArrayRef shape) {
  Tensor sum;
  for (const auto& each : files_) {
    const Tensor tensor = each->Take(key, shape);
    if (!tensor.defined()) return tensor;
    sum = sum.defined() ? sum + tensor.to(at::kDouble) : tensor.to(at::kDouble);
  }
  return (sum / static_cast<double>(files_.size())).to(at::kFloat);
}

TensorMetadata MeanWeights::Metadata() const {
  TensorMetadata metadata;
  for (const auto& [name, value] : files_.front()->file().metadata()) {
    if (const auto common = InCommon(files_, name)) {
      metadata.emplace(name, *common);
    } else if (kOfEach.contains(name)) {
      std::string all;
      for (const auto& each : files_) {
        const TensorMetadata& of = each->file().metadata();
        const auto found = of.find(name);
        all += (all.empty() ? "" : " | ") + (found == of.end() ? "?" : found->second);
      }
      metadata.emplace(name, all);
    }
  }
  for (const char* key : kWhatFor) {
    if (const std::string said = WhatAllSay(files_, key); !said.empty()) metadata[key] = said;
  }
  metadata.erase("holdout");  // of one of them, even where two are equal
  return metadata;
}

}  // namespace evac::nn
