#include "worldmodel/train/weight_files.h"

namespace evac::train {

CheckpointWeights::CheckpointWeights(const std::filesystem::path& path) : tensors_(TensorFile::OpenCheckpoint(path)) {}

Tensor CheckpointWeights::Take(const std::string& key, at::IntArrayRef shape) {
  const Tensor tensor = tensors_.Get(key);
  nn::CheckShape(file().name() + ": " + key, tensor, shape);
  return tensor.to(at::kFloat);
}

Tensor RoutedWeights::Take(const std::string& key, at::IntArrayRef shape) {
  for (const Route& route : routes_) {
    if (key.starts_with(route.prefix)) return route.source->Take(key, shape);
  }
  throw TensorError("no weights are given for '" + key + "'");
}

}  // namespace evac::train
