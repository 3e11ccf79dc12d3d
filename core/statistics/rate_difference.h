#pragma once

#include <cstdint>
#include <span>

#include "core/statistics/estimate.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/rates.h"

/// How far two success rates are apart: first - second, in [-1, 1] (docs/statistics.md).
/// Without data the value is undefined and the interval is [-1, 1]: nothing is known.
/// All throw InvalidInput for impossible counts and unless 0 < confidence < 1.
namespace evac {

/// Different initial states: hybrid score interval without continuity correction (Newcombe 1998, method 10).
Estimate NewcombeDifference(const Count& first, const Count& second, double confidence = 0.95);
/// The same from two rates with intervals of one confidence, as ClusteredWilsonInterval makes them of repeated states.
Estimate NewcombeOfRates(const Estimate& first, const Estimate& second);

/// Outcomes on the same initial states.
struct PairedOutcomes {
  Flips flips;             ///< the pairs where the two differ
  std::int64_t pairs = 0;  ///< all of them, those that agree too
};

/// All clusters' pairs together. @throws InvalidInput for impossible counts.
PairedOutcomes SumOf(std::span<const PairedOutcomes> clusters);

/// Same initial states: score interval (Tango 1998), the one of record. Its test is McNemar's.
Estimate TangoDifference(const PairedOutcomes& outcomes, double confidence = 0.95);

/// Pairs that come in clusters (several seeds or policies on one initial state) as the number of independent pairs that
/// would tell as much: divided by the design effect of their differences, at least 1, and rounded. Where that effect
/// cannot be seen (all differences are equal, or there is one cluster) each cluster counts as one pair, its flips as
/// their share of it. One pair per cluster: as they are.
/// @param clusters  each one initial state's pairs. @throws InvalidInput for impossible counts.
PairedOutcomes EffectivePairs(std::span<const PairedOutcomes> clusters);

/// The difference of pairs that come in clusters: its value is that of all, its interval Tango's of as many as
/// PairsOfInterval says. One pair per cluster: as TangoDifference. @throws as EffectivePairs and TangoDifference.
Estimate TangoOfClusters(std::span<const PairedOutcomes> clusters, double confidence = 0.95);

/// How many pairs that flip as these leave `limit` outside Tango's interval or on its end: its score grows with the
/// root of the pairs. Undefined without pairs, and where the difference is the limit itself.
/// @param limit  in (-1, 1)
Number PairsUntilTangoLeavesOut(double limit, const PairedOutcomes& outcomes, double confidence = 0.95);

/// All pairs of the clusters, and how many independent ones that interval rests on: EffectivePairs, but where few of
/// them differ from the rest, no more than leave it as wide as one pair of each cluster would if none did. One flip
/// alone does not show that all the pairs that agree are independent (docs/decisions/0012-interval-of-record.md).
Repeated PairsOfInterval(std::span<const PairedOutcomes> clusters, double confidence = 0.95);

/// Same initial states: Wald's interval with 1 added to each kind of flip and 2 to the pairs (Bonett & Price 2012). The
/// quick form; its value is that of the data as they are.
Estimate BonettPriceDifference(const PairedOutcomes& outcomes, double confidence = 0.95);

/// theta + delta from two independent estimates: the ends by the method of variance estimates recovery (Zou & Donner
/// 2008), which keeps the asymmetry of both intervals. Both must have a value and an interval; not clipped.
Interval MoverSum(const Estimate& theta, const Estimate& delta);

}  // namespace evac
