#include "worldmodel/nn/weights.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "worldmodel/nn/weight_keys.h"

namespace evac::nn {
namespace {

/// How far a number may be from the float it was rounded from.
double RoundingOf(TensorType type) {
  if (type == TensorType::kBF16) return 0.01;
  return type == TensorType::kF16 ? 1e-3 : 1e-5;
}

/// @returns why the file's schedule is put aside, or nothing.
std::string CompareSchedule(const MappedTensors& tensors, const ModelConfig& config) {
  const NoiseSchedule ours(config.schedule);
  const TensorFile& file = tensors.file();
  const Tensor theirs = tensors.Get("alphas_cumprod").to(at::kFloat);
  const float* bar = theirs.data_ptr<float>();
  const std::int64_t last = ours.steps() - 1;
  if (config.schedule.zero_terminal_snr && bar[last] != 0) {
    return file.name() + ": the schedule does not end in pure noise (alphas_cumprod[" + std::to_string(last) + "] is " +
           std::to_string(bar[last]) + ", wanted 0): the configuration's is used";
  }
  for (std::int64_t t = 0; t <= last; ++t) {
    if (std::abs(bar[t] - ours.AlphaBar(t)) <= RoundingOf(file.Get("alphas_cumprod").type)) continue;
    throw TensorError(file.name() + ": the schedule is another than the configuration's: alphas_cumprod[" +
                      std::to_string(t) + "] is " + std::to_string(bar[t]) + ", wanted " +
                      std::to_string(ours.AlphaBar(t)));
  }
  return {};
}

}  // namespace

FileWeights::FileWeights(const std::filesystem::path& path, const ModelConfig& config, const LoadOptions& options)
    : tensors_(TensorFile::OpenCheckpoint(path)), options_(options) {
  KeyFit fit = CompareKeys(file(), config);
  if (!fit.Fits()) throw TensorError(file().name() + " does not fit the configuration: " + fit.Complaint());
  report_ = {std::move(fit.unread), CompareSchedule(tensors_, config)};
  std::sort(report_.ignored_keys.begin(), report_.ignored_keys.end());
}

Tensor FileWeights::Take(const std::string& key, at::IntArrayRef shape) {
  const auto& ignored = report_.ignored_keys;
  const bool is_unread = !Has(key) || std::binary_search(ignored.begin(), ignored.end(), key);
  if (is_unread && (!options_.with_unread || !Has(key))) return {};
  const Tensor mapped = tensors_.Get(key);
  if (!is_unread) CheckShape(file().name() + ": " + key, mapped, shape);
  const Tensor tensor = mapped.to(mapped.options().dtype(options_.dtype).device(options_.device));
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
