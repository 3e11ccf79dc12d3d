#pragma once

#include <span>

#include "core/statistics/confusion.h"
#include "core/statistics/estimate.h"

/// Where a probability of success becomes a success.
namespace evac {

/// What comes of calling everything from a threshold on a success. Of the failures a share of 1 - specificity is called
/// successes then, of the successes 1 - sensitivity failures (core/statistics/confusion.h).
/// @param probabilities  in [0, 1]
/// @param outcomes       1 success, 0 failure, of the same length
/// @throws InvalidInput for anything else.
Confusion ConfusionAt(std::span<const double> probabilities, std::span<const int> outcomes, double threshold);

/// The threshold of .05, .06 … .95 at which as large a share of failures is called successes as of successes failures, or
/// comes closest to that; of several the one next to .5, the lower of two as near. A policy that succeeds half of the time
/// is told to. (Kappa is nearly the same over a wide range of thresholds, so its maximum is chance.) Undefined without a
/// success or without a failure. Parameters as above.
Number BalancedThreshold(std::span<const double> probabilities, std::span<const int> outcomes);

}  // namespace evac
