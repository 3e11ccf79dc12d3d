#include "worldmodel/train/trainable_weights.h"

#include <algorithm>

namespace evac::train {

TrainableWeights::TrainableWeights(nn::ParameterSource& initial, at::ScalarType product_type, at::Device device)
    : initial_(initial), product_type_(product_type), device_(device) {}

Tensor TrainableWeights::Take(const std::string& key, at::IntArrayRef shape) {
  const Tensor given = initial_.Take(key, shape);
  if (!given.defined()) return given;  // nothing reads it
  const at::NoGradGuard no_gradients;
  Tensor copy = at::empty(given.sizes(), given.options().dtype(at::kFloat).device(device_));
  copy.copy_(given);
  parameters_.push_back({key, copy});
  return copy;
}

std::optional<at::ScalarType> TrainableWeights::ProductType() const {
  return product_type_ == at::kFloat ? std::nullopt : std::optional(product_type_);
}

std::vector<NamedTensor> TrainableWeights::Trained(const std::function<bool(const std::string& key)>& is_wanted) const {
  std::vector<NamedTensor> trained;
  for (const NamedTensor& parameter : parameters_) {
    if (is_wanted(parameter.name)) trained.push_back(parameter);
  }
  return trained;
}

Tensor GivenWeights::Take(const std::string& key, at::IntArrayRef) {
  const auto found =
      std::find_if(tensors_.begin(), tensors_.end(), [&](const NamedTensor& tensor) { return tensor.name == key; });
  if (found == tensors_.end()) throw TensorError("there is no parameter '" + key + "'");
  return found->tensor;
}

}  // namespace evac::train
