#include "worldmodel/nn/noise.h"

#include <cmath>
#include <numbers>

namespace evac::nn {
namespace {

constexpr int kRounds = 10;
constexpr std::uint32_t kMultipliers[2] = {0xD2511F53, 0xCD9E8D57};
constexpr std::uint32_t kKeySteps[2] = {0x9E3779B9, 0xBB67AE85};

/// In (0, 1), 52 bits, never an end.
double Uniform(std::uint32_t high, std::uint32_t low) {
  const std::uint64_t bits = (std::uint64_t{high} << 32 | low) >> 12;
  return (static_cast<double>(bits) + 0.5) * 0x1.0p-52;
}

}  // namespace

std::array<std::uint32_t, 4> Philox4x32(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < kRounds; ++round) {
    const std::uint64_t first = std::uint64_t{kMultipliers[0]} * counter[0];
    const std::uint64_t second = std::uint64_t{kMultipliers[1]} * counter[2];
    counter = {static_cast<std::uint32_t>(second >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(second),
               static_cast<std::uint32_t>(first >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(first)};
    key = {key[0] + kKeySteps[0], key[1] + kKeySteps[1]};
  }
  return counter;
}

Tensor StandardNormal(const NoisePlace& place, at::IntArrayRef shape) {
  Tensor noise = at::empty(shape, at::TensorOptions().dtype(at::kFloat));
  float* const values = noise.data_ptr<float>();
  const std::array<std::uint32_t, 2> key = {static_cast<std::uint32_t>(place.seed),
                                            static_cast<std::uint32_t>(place.seed >> 32)};
  for (std::int64_t i = 0; i < noise.numel(); i += 2) {
    const auto pair = static_cast<std::uint64_t>(i / 2);
    const auto random = Philox4x32(
        {static_cast<std::uint32_t>(pair), static_cast<std::uint32_t>(pair >> 32), place.frame, place.step}, key);
    const double radius = std::sqrt(-2 * std::log(Uniform(random[0], random[1])));
    const double angle = 2 * std::numbers::pi * Uniform(random[2], random[3]);
    values[i] = static_cast<float>(radius * std::cos(angle));
    if (i + 1 < noise.numel()) values[i + 1] = static_cast<float>(radius * std::sin(angle));
  }
  return noise;
}

}  // namespace evac::nn
