#include "worldmodel/nn/train_memory.h"

#include <bit>

#include "worldmodel/nn/processors.h"

namespace evac::nn::kernels {

EVAC_EACH_PROCESSOR void FromBf16(std::int64_t count, const std::uint16_t* from, float* to) {
#pragma omp simd
  for (std::int64_t i = 0; i < count; ++i) to[i] = std::bit_cast<float>(static_cast<std::uint32_t>(from[i]) << 16);
}

EVAC_EACH_PROCESSOR void ToBf16(std::int64_t count, const float* from, std::uint16_t* to) {
#pragma omp simd
  for (std::int64_t i = 0; i < count; ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(from[i]);
    to[i] = static_cast<std::uint16_t>((bits + 0x7FFF + ((bits >> 16) & 1)) >> 16);
  }
}

}  // namespace evac::nn::kernels
