#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/statistics/estimate.h"

/// How far raters agree beyond chance (docs/statistics.md). 1: always; 0: as chance would.
namespace evac {

/// Fleiss 1971: every item rated by the same number of raters.
struct FleissKappa {
  Number kappa = Undefined{"no items"};      ///< undefined with one rater, and where all ratings are one category
  Number agreement = Undefined{"no items"};  ///< mean share of agreeing pairs of raters
  Number chance = Undefined{"no items"};     ///< the same by chance: sum of squared shares
  Number null_se = Undefined{"no items"};    ///< of kappa if there is no agreement (Fleiss, Nee & Landis 1979)
  Number z = Undefined{"no items"};          ///< kappa / null_se
  std::vector<double> shares;                ///< of each category in all ratings
  std::vector<Number> kappa_of_category;     ///< that category against all others
  std::int64_t items = 0, raters = 0;
};
/// @param counts  [items][categories] how many raters chose it.
/// @throws InvalidInput if items differ in their number of ratings or of categories, or a count is negative.
FleissKappa FleissKappaOf(const std::vector<std::vector<std::int64_t>>& counts);

/// How far apart two ratings are.
enum class RatingMetric {
  kNominal,   ///< equal or not
  kOrdinal,   ///< how many ratings lie between them
  kInterval,  ///< (a - b)²
  kRatio,     ///< ((a - b) / (a + b))²; ratings must not be negative
};

/// Krippendorff's alpha: any number of raters, missing ratings, any metric; the headline number of a rating session.
/// Items with fewer than two ratings cannot be paired and are left out. Undefined without pairs, and where all ratings
/// are equal.
/// @param ratings  [raters][items], all rows of one length.
/// @throws InvalidInput if rows differ in length, or a rating is not finite or (ratio) negative.
Number KrippendorffAlpha(const std::vector<std::vector<std::optional<double>>>& ratings, RatingMetric metric);

}  // namespace evac
