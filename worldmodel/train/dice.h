#pragma once

#include <cstdint>

#include "worldmodel/nn/tensor.h"

namespace evac::train {

using at::Tensor;

/// Which step of a training: everything random in it is a function of this.
struct StepPlace {
  std::uint64_t seed = 0;
  std::int64_t step = 0;  ///< from 0
  std::int64_t part = 0;  ///< of the step, where gradients are accumulated
  double done = 0;        ///< how much of the training lies behind, 0 to 1; random numbers do not depend on it
};

/// Random numbers whose state cannot be lost: the n-th draw at (seed, step, part, stream) is always the same, so a
/// training that was killed goes on with the numbers that it would have seen.
class Dice {
 public:
  /// @param stream  what the numbers are for: streams know nothing of each other
  Dice(const StepPlace& place, std::uint32_t stream);

  double Uniform();  ///< [0, 1)
  double Uniform(double from, double to) { return from + (to - from) * Uniform(); }
  std::int64_t Below(std::int64_t count);  ///< 0 … count - 1
  bool Chance(double probability) { return Uniform() < probability; }
  /// Standard normal numbers, float on the CPU.
  Tensor Normal(at::IntArrayRef shape);

 private:
  std::uint64_t key_;
  std::uint32_t step_, drawn_ = 0;
};

}  // namespace evac::train
