#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/statistics/estimate.h"

namespace evac {

struct BettingOptions {
  double confidence = 0.95;
  double truncation = 0.5;  ///< c in (0, 1]: no bet may lose more than this share of the money
  double share = 0.5;       ///< theta in (0, 1) of the money bets that the mean is above m, the rest below
};

/// The mean of values in [0, 1] by hedged capital with bets for a fixed n (Waudby-Smith & Ramdas 2024, Sec. 4): covers
/// at every n, whatever the distribution. **Depends on the order of the values**: one that is not by chance must be
/// shuffled first (SeededShuffle).
/// No values: undefined in [0, 1]. Undefined interval where every mean is refuted (values that drift).
/// @throws InvalidInput for a value outside [0, 1] or an option out of range.
Estimate BettingInterval(std::span<const double> values, const BettingOptions& options = {});

/// Fisher-Yates with SplitMix64(seed): the same order everywhere.
std::vector<double> SeededShuffle(std::span<const double> values, std::uint64_t seed);

}  // namespace evac
