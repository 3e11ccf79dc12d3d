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

}  // namespace

/// Of the buffers two are asked: how much noise there is, which decides the others, and what clean latents are scaled
/// by (spec 8.1).
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
