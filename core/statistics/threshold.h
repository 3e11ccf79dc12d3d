#pragma once

#include <cstdint>
#include <span>

#include "core/statistics/estimate.h"

/// Where a probability of success becomes a success.
namespace evac {

/// What is called wrongly when everything from a threshold on is called a success.
struct ThresholdErrors {
  std::int64_t failures = 0, called_successes = 0;   ///< and how many of those failures
  std::int64_t successes = 0, called_failures = 0;
  Number HallucinatedShare() const;  ///< of the failures; undefined without any
  Number MissedShare() const;        ///< of the successes; likewise
  Number Agreement() const;          ///< undefined without either
};

/// @param probabilities  in [0, 1]
/// @param outcomes       1 success, 0 failure, of the same length
/// @throws InvalidInput for anything else.
ThresholdErrors ErrorsAt(std::span<const double> probabilities, std::span<const int> outcomes, double threshold);

/// The threshold of .05, .06 … .95 at which as large a share of failures is called successes as of successes failures, or
/// comes closest to that; of several the one next to .5, the lower of two as near. A policy that succeeds half of the time
/// is told to. (Kappa is nearly the same over a wide range of thresholds, so its maximum is chance.) Undefined without a
/// success or without a failure. Parameters as above.
Number BalancedThreshold(std::span<const double> probabilities, std::span<const int> outcomes);

}  // namespace evac
