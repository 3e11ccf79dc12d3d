#pragma once

#include <array>
#include <cstdint>

#include "worldmodel/nn/tensor.h"

/// Random numbers without a state: each is a function of where it stands, so they are the same on every device, for any
/// number of threads and in any order.
namespace evac::nn {

/// Philox 4x32 with 10 rounds (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").
std::array<std::uint32_t, 4> Philox4x32(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key);

/// Which noise: one tensor per place.
struct NoisePlace {
  std::uint64_t seed = 0;   ///< of the episode and the purpose
  std::uint32_t frame = 0;  ///< of the episode
  std::uint32_t step = 0;   ///< of the sampler
};

/// Standard normal numbers, float on the CPU: Box and Muller's transform in double of 52-bit uniform numbers, two
/// elements per counter, rounded once at the end.
Tensor StandardNormal(const NoisePlace& place, at::IntArrayRef shape);

}  // namespace evac::nn
