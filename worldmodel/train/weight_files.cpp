#include "worldmodel/train/weight_files.h"

#include <algorithm>

namespace evac::train {

CheckpointWeights::CheckpointWeights(const std::filesystem::path& path) : tensors_(TensorFile::OpenCheckpoint(path)) {}

Tensor CheckpointWeights::Take(const std::string& key, at::IntArrayRef shape) {
  const Tensor tensor = tensors_.Get(key);
  nn::CheckShape(file().name() + ": " + key, tensor, shape);
  return tensor.to(at::kFloat);
}

WidenedWeights::WidenedWeights(const std::filesystem::path& path, bool object_forecast)
    : tensors_(TensorFile::OpenCheckpoint(path)) {
  const bool has_forecast = std::ranges::any_of(tensors_.file().tensors(), [](const TensorView& tensor) {
    return tensor.name.starts_with(nn::kForecastPrefix);
  });
  if (has_forecast && !object_forecast)
    throw TensorError(path.string() +
                      ": its model has an object_forecast, wanted object_forecast: true on the page of sizes");
  last_ = has_forecast ? 1 : 0;
}

Tensor WidenedWeights::Take(const std::string& key, at::IntArrayRef shape) {
  Tensor tensor = tensors_.Get(key).to(at::kFloat);
  const std::int64_t lacks = tensor.dim() == 4 && shape.size() == 4 ? shape[1] - tensor.size(1) : 0;
  if (key == kFirstLayer && lacks > 0) {
    const std::int64_t first = tensor.size(1) - last_;
    const Tensor added = at::zeros({tensor.size(0), lacks, tensor.size(2), tensor.size(3)});
    tensor = at::cat({tensor.narrow(1, 0, first), added, tensor.narrow(1, first, last_)}, 1);
  }
  nn::CheckShape(tensors_.file().name() + ": " + key, tensor, shape);
  return tensor;
}

Tensor RoutedWeights::Take(const std::string& key, at::IntArrayRef shape) {
  for (const Route& route : routes_) {
    if (key.starts_with(route.prefix)) return route.source->Take(key, shape);
  }
  throw TensorError("no weights are given for '" + key + "'");
}

}  // namespace evac::train
