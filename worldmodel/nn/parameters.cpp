#include "worldmodel/nn/parameters.h"

#include <cmath>

namespace evac::nn {
namespace {

std::uint64_t Fnv1a(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

/// The i-th number of a key's stream, in [-1, 1) with 24 bits.
double HashUniform(std::uint64_t hash, std::uint64_t i) {
  std::uint64_t z = hash + (i + 1) * 0x9E3779B97F4A7C15;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
  z ^= z >> 31;
  return static_cast<double>(z >> 40) / 16777216.0 * 2 - 1;
}

}  // namespace

Tensor KeyList::Take(const std::string& key, at::IntArrayRef shape) {
  keys_.push_back({key, shape.vec()});
  return {};
}

Tensor HashWeights::Take(const std::string& key, at::IntArrayRef shape) {
  Tensor tensor = at::empty(shape, at::kFloat);
  if (shape.empty()) return tensor.fill_(2.6593F);  // CLIP's logit scale, which nothing reads
  double offset = 0, factor = 0.1;
  if (shape.size() >= 2) {
    factor = std::sqrt(3.0 / (static_cast<double>(tensor.numel()) / static_cast<double>(shape[0])));
  } else if (key.ends_with("weight")) {
    offset = 1, factor = 0.2;
  }
  const std::uint64_t hash = Fnv1a(key);
  float* values = tensor.data_ptr<float>();
  for (std::int64_t i = 0; i < tensor.numel(); ++i)
    values[i] = static_cast<float>(offset + HashUniform(hash, static_cast<std::uint64_t>(i)) * factor);
  return tensor;
}

Tensor RecordedWeights::Take(const std::string& key, at::IntArrayRef shape) {
  Tensor tensor = source_.Take(key, shape);
  parameters_.push_back({key, tensor});
  return tensor;
}

const Tensor& RecordedWeights::Get(const std::string& key) const {
  for (const Parameter& parameter : parameters_) {
    if (parameter.key == key) return parameter.tensor;
  }
  throw TensorError("there is no parameter '" + key + "'");
}

}  // namespace evac::nn
