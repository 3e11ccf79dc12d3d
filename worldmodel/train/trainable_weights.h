#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "worldmodel/nn/parameters.h"
#include "worldmodel/train/flat_parameters.h"

namespace evac::train {

/// Parameters that may be written to: copies of another source's as floats, kept by key. A network made from it is
/// trained by a Trainer that is given what it `Trained`, and saved from it again.
class TrainableWeights final : public nn::ParameterSource {
 public:
  /// @param product_type  of matrix products and convolutions: floats, or bf16 to compute faster and coarser
  explicit TrainableWeights(nn::ParameterSource& initial, at::ScalarType product_type = at::kFloat,
                            at::Device device = at::kCPU);
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
  std::optional<at::ScalarType> ProductType() const override;

  /// Those whose key is wanted, in the order in which they were asked for.
  std::vector<NamedTensor> Trained(const std::function<bool(const std::string& key)>& is_wanted) const;
  const std::vector<NamedTensor>& all() const { return parameters_; }

 private:
  nn::ParameterSource& initial_;
  at::ScalarType product_type_;
  at::Device device_;
  std::vector<NamedTensor> parameters_;
};

/// Gives tensors that are there, by key: to save what was trained.
class GivenWeights final : public nn::ParameterSource {
 public:
  explicit GivenWeights(const std::vector<NamedTensor>& tensors) : tensors_(tensors) {}
  /// @throws TensorError naming the key if it is not among them
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;

 private:
  const std::vector<NamedTensor>& tensors_;
};

}  // namespace evac::train
