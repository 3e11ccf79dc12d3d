#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "worldmodel/nn/tensor.h"

/// Where modules get their numbers from. A module asks for each parameter by key and shape when it is made; it never
/// looks into them then. So one description of the network lists keys, loads files, draws noise and makes test weights.
namespace evac::nn {

class ParameterSource {
 public:
  virtual ~ParameterSource() = default;
  /// @param key  as in the published checkpoint: "model.diffusion_model.out.2.weight".
  virtual Tensor Take(const std::string& key, at::IntArrayRef shape) = 0;
  /// The type in which matrix products and convolutions are computed; nothing: that of their weights. Training keeps
  /// its weights as floats and may ask for products in bf16.
  virtual std::optional<at::ScalarType> ProductType() const { return std::nullopt; }
};

/// A place in the tree of keys: `Linear(at / "to_q", …)` takes "…to_q.weight".
class Scope {
 public:
  Scope(ParameterSource& source, std::string prefix) : source_(&source), prefix_(std::move(prefix)) {}
  Scope operator/(const std::string& name) const { return {*source_, prefix_.empty() ? name : prefix_ + "." + name}; }
  Scope operator/(std::int64_t index) const { return *this / std::to_string(index); }
  Tensor Take(const std::string& name, at::IntArrayRef shape) const {
    return source_->Take((*this / name).prefix_, shape);
  }
  std::optional<at::ScalarType> ProductType() const { return source_->ProductType(); }

 private:
  ParameterSource* source_;
  std::string prefix_;
};

struct ParameterShape {
  std::string key;
  std::vector<std::int64_t> shape;
};

/// Allocates nothing: lists what a network would ask for, in order.
class KeyList final : public ParameterSource {
 public:
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
  const std::vector<ParameterShape>& keys() const { return keys_; }

 private:
  std::vector<ParameterShape> keys_;
};

/// Weights made of the keys' hashes, the same everywhere: for tests (`golden` folders, tests/golden).
/// Sides of two and more: uniform with variance 1/fan-in; "….weight" of one side: 1 ± .2; others: ± .1.
class HashWeights final : public ParameterSource {
 public:
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
};

/// Keeps what another source gave, by key: for optimisers and for saving.
class RecordedWeights final : public ParameterSource {
 public:
  struct Parameter {
    std::string key;
    Tensor tensor;
  };
  explicit RecordedWeights(ParameterSource& source) : source_(source) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
  std::optional<at::ScalarType> ProductType() const override { return source_.ProductType(); }
  const std::vector<Parameter>& parameters() const { return parameters_; }
  /// @throws TensorError if no such key was asked for.
  const Tensor& Get(const std::string& key) const;

 private:
  ParameterSource& source_;
  std::vector<Parameter> parameters_;
};

}  // namespace evac::nn
