#pragma once

#include "core/statistics/estimate.h"
#include "core/statistics/rate_pairs.h"

namespace evac {

/// How far the tested world's rates are from the real ones, not only whether they go together (docs/statistics.md).
/// All are undefined without points.
struct RateAgreement {
  Number bias = Undefined{"no points"};     ///< mean(S - R): above 0 where the tested world is too kind
  Number mae = Undefined{"no points"};      ///< mean |S - R|
  Number rmse = Undefined{"no points"};     ///< sqrt(mean (S - R)²)
  Number max_abs = Undefined{"no points"};  ///< max |S - R|
  Number ccc = Undefined{"no points"};  ///< Lin's concordance, 1/n variances; undefined if all S and R are one value
};

/// @throws InvalidInput if the lengths differ or a value is not finite.
RateAgreement AgreementOf(const RatePairs& pairs);

}  // namespace evac
