#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

/// Comparisons over several tasks, or of several policies, at once (docs/statistics.md).
namespace evac {

/// One task: the two rates compared in it.
struct Stratum {
  Weighted first, second;
};

/// Cochran-Mantel-Haenszel without continuity correction: are the two rates equal within every stratum? Different
/// initial states. A stratum where one side has no trials says nothing and is left out.
struct StratifiedTest {
  Number chi2 = Undefined{"no stratum can tell"};  ///< 1 degree of freedom; undefined where no outcome varies
  Number p = Undefined{"no stratum can tell"};
  Number odds_ratio = Undefined{"no stratum can tell"};  ///< Mantel-Haenszel
  Estimate risk_difference;  ///< Mantel-Haenszel's mean of first - second; interval with Sato's variance (1989)
  Number difference_se = Undefined{"no trials"};  ///< the root of that variance; undefined with the interval
};
/// @throws InvalidInput for impossible numbers and unless 0 < confidence < 1.
StratifiedTest MantelHaenszel(std::span<const Stratum> strata, double confidence = 0.95);

/// Cochran's Q: do k policies succeed equally often on the same initial states? k = 2 is McNemar's chi-square.
struct CochranQ {
  Number q = Undefined{"no state tells the policies apart"};
  Number p = Undefined{"no state tells the policies apart"};
  std::int64_t degrees = 0;  ///< k - 1
};
/// @param outcomes  [states][policies] success or not, every state with the same number of policies.
/// @throws InvalidInput if the rows differ in length.
CochranQ CochranQTest(const std::vector<std::vector<bool>>& outcomes);

}  // namespace evac
