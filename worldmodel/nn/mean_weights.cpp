#include "worldmodel/nn/mean_weights.h"

#include <ATen/ops/allclose.h>
#include <ATen/ops/equal.h>

#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "worldmodel/nn/weight_keys.h"

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

/// The lines of "sizes" that any file says, where all say some: cards of earlier versions have fewer.
/// @throws TensorError if two say one otherwise
std::string SizesTogether(const std::vector<std::unique_ptr<FileWeights>>& files) {
  std::map<std::string, std::pair<std::string, const TensorFile*>> known;
  std::string all;
  for (const auto& each : files) {
    const TensorFile& file = each->file();
    const auto sizes = file.metadata().find("sizes");
    if (sizes == file.metadata().end()) return "";
    std::istringstream lines(sizes->second);
    for (std::string line; std::getline(lines, line);) {
      const auto [found, is_new] = known.try_emplace(line.substr(0, line.find(' ')), line, &file);
      if (is_new) all += line + "\n";
      if (found->second.first != line)
        throw TensorError("the mean of weights: " + found->second.second->name() + " was trained with '" +
                          found->second.first + "', " + file.name() + " with '" + line + "'");
    }
  }
  return all;
}

std::optional<at::ScalarType> HalfOf(const FileWeights& weights, const std::string& key) {
  const TensorType type = weights.file().Get(key).type;
  if (type == TensorType::kBF16) return at::kBFloat16;
  return type == TensorType::kF16 ? std::optional(at::kHalf) : std::nullopt;
}

/// Whether the numbers are the same as far as the coarser of the two types tells. Two kinds of halves were rounded
/// differently: of those all but the last digit, and what is too small for one of them.
bool AreSame(FileWeights& one, FileWeights& other, const std::string& key, at::IntArrayRef shape) {
  const Tensor a = one.Take(key, shape), b = other.Take(key, shape);
  if (!a.defined() || !b.defined()) return true;  // nothing reads it
  const auto of_a = HalfOf(one, key), of_b = HalfOf(other, key);
  if (of_a && of_b && *of_a != *of_b) return at::allclose(a, b, 1.0 / 128, 1e-7);
  const at::ScalarType coarser = of_a ? *of_a : of_b.value_or(at::kFloat);
  return at::equal(a.to(coarser), b.to(coarser));
}

bool IsOfCodec(const std::string& key) { return key.starts_with("first_stage_model"); }

/// What a world model's training leaves as it is: the codec, which says what latents mean, and the forecast, which says
/// what the denoiser is shown. Between two of them, or one and its rounding, a mean is neither.
bool IsLeftAsItIs(const std::string& key) { return IsOfCodec(key) || key.starts_with(kForecastPrefix); }

/// The first file whose numbers are floats, or the first of all.
FileWeights& WithMostDigits(const std::vector<std::unique_ptr<FileWeights>>& files, const std::string& key) {
  FileWeights* found = files.front().get();
  for (const auto& each : files) {
    if (each->Has(key) && found->Has(key) && HalfOf(*found, key) && !HalfOf(*each, key)) found = each.get();
  }
  return *found;
}

void RequireSameCodecAndForecast(const std::vector<std::unique_ptr<FileWeights>>& files, const ModelConfig& config) {
  for (const auto& [key, shape] : CheckpointKeys(config)) {
    if (!IsLeftAsItIs(key)) continue;
    FileWeights& wanted = WithMostDigits(files, key);
    for (const auto& each : files) {
      if (each.get() != &wanted && !AreSame(wanted, *each, key, shape))
        throw TensorError("the mean of weights: " + key + " is another in " + wanted.file().name() + " than in " +
                          each->file().name() + ": wanted trainings with one " +
                          (IsOfCodec(key) ? "codec" : "forecast"));
    }
  }
}

}  // namespace

MeanWeights::MeanWeights(const std::vector<std::filesystem::path>& paths, const ModelConfig& config) {
  if (paths.size() < 2)
    throw TensorError("the mean of weights: found " + std::to_string(paths.size()) + " file, wanted at least two");
  const LoadOptions copied{.is_run = false};
  for (const auto& path : paths) files_.push_back(std::make_unique<FileWeights>(path, config, copied));
  bool any_codec = false;
  for (const auto& each : files_) any_codec = any_codec || each->file().metadata().contains("codec");
  if (any_codec && !InCommon(files_, "codec"))
    throw TensorError("the mean of weights: their cards name different codecs, or only some name one: latents would mean different things");
  for (const char* key : kWhatFor) WhatAllSay(files_, key);
  SizesTogether(files_);
  RequireSameCodecAndForecast(files_, config);
}

Tensor MeanWeights::Take(const std::string& key, at::IntArrayRef shape) {
  if (IsLeftAsItIs(key)) return WithMostDigits(files_, key).Take(key, shape);
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
  if (const std::string sizes = SizesTogether(files_); !sizes.empty()) metadata["sizes"] = sizes;
  metadata.erase("holdout");  // of one of them, even where two are equal
  return metadata;
}

}  // namespace evac::nn
