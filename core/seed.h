#pragma once

#include <cstdint>
#include <string_view>

namespace evac {

/// splitmix64 (Vigna, public domain): a counter-based generator small enough to own one per purpose.
/// Seed 0 gives 0xE220A8397B1DCDAF first.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

  std::uint64_t Next();
  /// Uniform in [0, bound): the high 64 bits of Next() * bound. @param bound > 0.
  std::uint64_t Below(std::uint64_t bound);
  /// Uniform in [0, 1), 53 bits.
  double Uniform();
  /// Uniform in [low, high).
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  /// Standard normal (Box–Muller, two draws per value, nothing kept between calls).
  double Normal();

 private:
  std::uint64_t state_;
};

/// An independent seed for a named purpose: `SeedFor(seed, "camera noise")`. Stable across versions and platforms.
std::uint64_t SeedFor(std::uint64_t seed, std::string_view purpose);
/// The same for the index-th thing of a kind.
std::uint64_t SeedFor(std::uint64_t seed, std::uint64_t index);

}  // namespace evac
