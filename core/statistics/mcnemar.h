#pragma once

#include <cstdint>

#include "core/statistics/estimate.h"

namespace evac {

/// Paired outcomes that disagree: the same initial state, seed, policy in two worlds (or two policies in one).
struct Flips {
  std::int64_t only_first = 0;   ///< b: success in the first, failure in the second
  std::int64_t only_second = 0;  ///< c: failure in the first, success in the second
};

/// McNemar's test (1947) of "the two rates are equal", two-sided (docs/statistics.md). b = c = 0: p is 1, chi-square
/// undefined.
struct McNemar {
  double p_exact = 1;                            ///< min(1, 2 P(Bin(b + c, 1/2) <= min(b, c)))
  double p_mid = 1;                              ///< 2 P(X < min) + P(X = min): less conservative, exactly 1 when b = c
  Number chi2 = Undefined{"no pair disagrees"};  ///< (b - c)² / (b + c)
  Number p_chi2 = Undefined{"no pair disagrees"};          ///< its upper tail, 1 degree of freedom
  Number chi2_corrected = Undefined{"no pair disagrees"};  ///< Edwards: (|b - c| - 1)² / (b + c)
};

/// @throws InvalidInput if a count is negative.
McNemar McNemarExact(const Flips& flips);

}  // namespace evac
