#pragma once

#include <cmath>

#include "worldmodel/nn/weights.h"

namespace evac {

/// First weights for networks of rectified layers without norms: uniform with variance 2 / fan-in (He et al. 2015), so
/// that what goes through keeps its size; the layer `out` a tenth of it, so that first answers are near 0. Offsets 0,
/// tables as RandomWeights has them. Functions of (seed, key, index).
class ReluWeights final : public nn::ParameterSource {
 public:
  explicit ReluWeights(std::uint64_t seed) : random_(seed) {}
  nn::Tensor Take(const std::string& key, at::IntArrayRef shape) override {
    const nn::Tensor drawn = random_.Take(key, shape);  // variance 1 / (3 fan-in)
    const double size = std::sqrt(6.0) * (key == "out.weight" ? 0.1 : 1);
    return shape.size() > 1 && key.ends_with(".weight") ? drawn * size : drawn;
  }

 private:
  nn::RandomWeights random_;
};

}  // namespace evac
