#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/statistics/estimate.h"

/// Association between two sequences of the same length (docs/statistics.md).
/// Undefined, with the reason: fewer than 2 points, or a sequence whose values are all equal (max == min, not
/// "variance is 0": rounding hides that). Two points make every coefficient ±1 or undefined: reports refuse that.
/// All throw InvalidInput if the lengths differ or a value is not finite.
namespace evac {

/// Product-moment correlation; interval by Fisher's z, se 1 / sqrt(n - 3), undefined for n <= 3 or |r| = 1.
Estimate Pearson(std::span<const double> x, std::span<const double> y, double confidence = 0.95);

/// Pearson of the ranks, ties averaged; interval by Bonett & Wright 2000, se sqrt((1 + r²/2) / (n - 3)).
Estimate Spearman(std::span<const double> x, std::span<const double> y, double confidence = 0.95);

/// Two-sided p of "the correlation is 0", Student's t with n - 2 degrees of freedom. Undefined for n <= 2 or |r| = 1.
Number PearsonPValue(const Estimate& pearson);

/// Pairs of points in the same order, in opposite order, and tied; a pair tied in both counts in both ties.
struct Kendall {
  Number tau_b = Undefined{"not computed"};
  std::int64_t concordant = 0, discordant = 0, ties_x = 0, ties_y = 0;
};
Kendall KendallTauB(std::span<const double> x, std::span<const double> y);

/// Ranks from 1, ties share their average: {5, 3, 5} → {2.5, 1, 2.5}.
std::vector<double> AverageRanks(std::span<const double> values);

}  // namespace evac
