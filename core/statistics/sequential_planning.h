#pragma once

#include <cstdint>

#include "core/statistics/planning.h"

/// How many pairs until a test that may be looked at at any time has decided (docs/statistics.md). Of one look, at
/// that size: flips whose difference is as unfavourable as only 1 - power of all are, by the normal approximation, still
/// decide there. Looks before it can only decide sooner. Undefined above `most` pairs. All throw InvalidInput for flips
/// outside [0, 1] or together above 1, and for alpha or power outside (0, 1).
namespace evac {

/// Until the bet on which side flips go to (FlipsEValue) reaches 1 / alpha. Undefined for equal rates.
SampleSize PairsForFlipsBet(const FlipRates& rates, const Promise& promise = {}, std::int64_t most = 1'000'000);

/// Until the low end of SequentialPairedDifference at confidence 1 - alpha is above -margin: the first's rate is not
/// below the second's by `margin` or more. Undefined where the rates are that far apart. 0 < margin < 1.
SampleSize PairsForSequentialNonInferiority(const FlipRates& rates, double margin, const Promise& promise = {},
                                            std::int64_t most = 1'000'000);

}  // namespace evac
