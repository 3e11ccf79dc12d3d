#include "core/seed.h"

#include <cmath>
#include <numbers>

namespace evac {

std::uint64_t SplitMix64::Next() {
  state_ += 0x9E3779B97F4A7C15ULL;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

std::uint64_t SplitMix64::Below(std::uint64_t bound) {
  __extension__ using Wide = unsigned __int128;
  return static_cast<std::uint64_t>((static_cast<Wide>(Next()) * bound) >> 64);
}

double SplitMix64::Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }

double SplitMix64::Normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * Uniform());
}

std::uint64_t SeedFor(std::uint64_t seed, std::string_view purpose) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;  // FNV-1a, then mixed with the seed by splitmix64
  for (const unsigned char c : purpose) hash = (hash ^ c) * 0x100000001B3ULL;
  return SplitMix64(SplitMix64(seed).Next() ^ hash).Next();
}

std::uint64_t SeedFor(std::uint64_t seed, std::uint64_t index) {
  return SplitMix64(SplitMix64(seed).Next() + index).Next();
}

}  // namespace evac
