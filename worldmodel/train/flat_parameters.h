#pragma once

#include <string>
#include <vector>

#include "worldmodel/nn/tensor.h"

namespace evac::train {

using at::Tensor;

struct NamedTensor {
  std::string name;
  Tensor tensor;
};

/// All that is trained as one vector of floats, its gradients as another: an optimiser is a loop over them, a
/// checkpoint a few tensors. The tensors that were given become windows into it, for everybody who holds them.
class FlatParameters {
 public:
  /// @param parameters  floats, on one device; from now on they ask for gradients
  /// @throws TensorError naming a parameter that is not of floats, is named twice, or if there is none
  explicit FlatParameters(std::vector<NamedTensor> parameters);
  /// A second set of the same names and shapes, which becomes windows into the first one's values and has gradients of
  /// its own. @throws TensorError if they are others
  FlatParameters(std::vector<NamedTensor> parameters, const FlatParameters& first);

  const Tensor& values() const { return values_; }        ///< [count]
  const Tensor& gradients() const { return gradients_; }  ///< [count]
  const std::vector<NamedTensor>& parameters() const { return parameters_; }
  std::int64_t count() const { return values_.numel(); }
  /// "NAME [2, 3];…": two sets of parameters that have the same text may read each other's checkpoints.
  std::string Layout() const;
  /// A vector of `count` numbers as tensors of the parameters' names and shapes.
  std::vector<NamedTensor> Unflatten(const Tensor& flat) const;

 private:
  void MakeWindows();

  std::vector<NamedTensor> parameters_;
  Tensor values_, gradients_;
};

}  // namespace evac::train
