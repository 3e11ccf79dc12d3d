#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/statistics/rates.h"

/// "Two success rates are equal", on different initial states, however many there are (docs/statistics.md).
namespace evac {

/// Effective trials of both together; above, Newcombe's interval says nearly the same as the exact test, and at once.
inline constexpr std::int64_t kMostExactTrials = 1000;

struct TwoSampleTest {
  std::string method;    ///< "Boschloo", "Newcombe"
  double two_sided = 1;  ///< twice the smaller one-sided p, at most 1
  double greater = 1;    ///< against "the first rate is above the second"
  double less = 1;       ///< against "the first rate is below the second"
};

/// Boschloo's test of the effective counts; above kMostExactTrials the alpha from which on Newcombe's interval of the
/// clustered rates leaves out 0 (inverted_interval.h). Without trials in one of the two every p is 1.
/// @param first, second  each cluster one initial state's trials. @throws InvalidInput for impossible counts.
TwoSampleTest BoschlooOrNewcombe(std::span<const Count> first, std::span<const Count> second);

}  // namespace evac
