#include "worldmodel/train/dice.h"

#include "worldmodel/nn/noise.h"

namespace evac::train {
namespace {

/// The finaliser of SplitMix64 (Steele et al. 2014).
std::uint64_t Mix(std::uint64_t z) {
  z += 0x9E3779B97F4A7C15;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
  return z ^ (z >> 31);
}

}  // namespace

Dice::Dice(const StepPlace& place, std::uint32_t stream)
    : key_(Mix(Mix(Mix(place.seed) + stream) + static_cast<std::uint64_t>(place.part))),
      step_(static_cast<std::uint32_t>(place.step)) {}

double Dice::Uniform() {
  // The last counter word keeps these apart from the tensors, whose elements are counted in the first two.
  const auto random = nn::Philox4x32({drawn_++, 0, step_, 0xFFFFFFFF},
                                     {static_cast<std::uint32_t>(key_), static_cast<std::uint32_t>(key_ >> 32)});
  const std::uint64_t bits = (static_cast<std::uint64_t>(random[0]) << 21) ^ (random[1] >> 11);
  return static_cast<double>(bits & ((std::uint64_t{1} << 53) - 1)) * 0x1p-53;
}

std::int64_t Dice::Below(std::int64_t count) {
  return static_cast<std::int64_t>(Uniform() * static_cast<double>(count));
}

Tensor Dice::Normal(at::IntArrayRef shape) {
  return nn::StandardNormal({Mix(key_ + 1 + drawn_++), 0, step_}, shape);
}

}  // namespace evac::train
