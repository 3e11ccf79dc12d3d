#pragma once

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

/// Tests of "two success rates are equal", on different initial states (docs/statistics.md). For the same initial
/// states use McNemar. Tables are ordered by exact integers: two tables that are equally extreme are never told apart by
/// rounding. Without trials in one of the two every p is 1.
/// All throw InvalidInput unless 0 <= successes <= trials, and above 5000 trials together: BoschlooOrNewcombe
/// (two_samples.h) takes any number.
namespace evac {

struct ExactTest {
  double two_sided = 1;
  double greater = 1;  ///< against "the first rate is above the second"
  double less = 1;     ///< against "the first rate is below the second"
};

/// Conditional on the total of successes. Two-sided: all tables no more probable than this one. Conservative.
ExactTest FisherExact(const Count& first, const Count& second);

/// Unconditional, ordered by the pooled z; the worst case over the common rate (Barnard 1945).
ExactTest BarnardExact(const Count& first, const Count& second);

/// Unconditional, ordered by Fisher's p; the worst case over the common rate (Boschloo 1970). Never less powerful than
/// Fisher. Two-sided: twice the smaller one-sided p. The default.
ExactTest BoschlooExact(const Count& first, const Count& second);

/// (p1 - p2) / sqrt(p (1 - p)(1 / n1 + 1 / n2)), p pooled; 0 where all outcomes are equal.
double PooledZ(const Count& first, const Count& second);

}  // namespace evac
