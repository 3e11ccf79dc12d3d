#include "worldmodel/train/flat_parameters.h"

#include <set>
#include <utility>

namespace evac::train {
namespace {

void Check(const std::vector<NamedTensor>& parameters) {
  if (parameters.empty()) throw TensorError("nothing to train: no parameter is given");
  std::set<std::string> names;
  for (const auto& [name, tensor] : parameters) {
    if (!names.insert(name).second) throw TensorError("parameter '" + name + "' is given twice");
    if (!tensor.defined() || tensor.scalar_type() != at::kFloat)
      throw TensorError("parameter '" + name + "': only floats are trained");
  }
}

}  // namespace

FlatParameters::FlatParameters(std::vector<NamedTensor> parameters) : parameters_(std::move(parameters)) {
  Check(parameters_);
  const at::NoGradGuard no_gradients;
  std::vector<Tensor> parts;
  for (const NamedTensor& parameter : parameters_) parts.push_back(parameter.tensor.detach().flatten());
  values_ = at::cat(parts);
  MakeWindows();
}

FlatParameters::FlatParameters(std::vector<NamedTensor> parameters, const FlatParameters& first)
    : parameters_(std::move(parameters)), values_(first.values()) {
  Check(parameters_);
  if (Layout() != first.Layout()) throw TensorError("a replica of other parameters than those that are trained");
  MakeWindows();
}

void FlatParameters::MakeWindows() {
  const at::NoGradGuard no_gradients;
  gradients_ = at::zeros(values_.sizes(), values_.options());
  std::int64_t from = 0;
  for (NamedTensor& parameter : parameters_) {
    Tensor& tensor = parameter.tensor;
    const std::int64_t count = tensor.numel();
    const std::vector<std::int64_t> shape = tensor.sizes().vec();
    tensor.set_data(values_.narrow(0, from, count).view(shape));
    tensor.set_requires_grad(true);
    tensor.mutable_grad() = gradients_.narrow(0, from, count).view(shape);
    from += count;
  }
}

std::string FlatParameters::Layout() const {
  std::string text;
  for (const NamedTensor& parameter : parameters_)
    text += parameter.name + " " + nn::ShapeText(parameter.tensor.sizes()) + ";";
  return text;
}

std::vector<NamedTensor> FlatParameters::Unflatten(const Tensor& flat) const {
  std::vector<NamedTensor> parts;
  std::int64_t from = 0;
  for (const NamedTensor& parameter : parameters_) {
    const std::int64_t count = parameter.tensor.numel();
    parts.push_back({parameter.name, flat.narrow(0, from, count).view(parameter.tensor.sizes())});
    from += count;
  }
  return parts;
}

}  // namespace evac::train
