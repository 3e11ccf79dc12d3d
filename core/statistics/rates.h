#pragma once

#include <cstdint>
#include <span>

#include "core/statistics/estimate.h"

/// One success rate and its interval (docs/statistics.md). Each takes k = `successes` of n = `trials`.
/// n = 0: the value is undefined, the interval is [0, 1]: nothing is known.
/// All throw InvalidInput unless 0 <= k <= n and 0 < confidence < 1.
namespace evac {

struct Count {
  std::int64_t successes = 0, trials = 0;
};
/// @throws InvalidInput unless 0 <= successes <= trials.
void CheckCount(const Count& count);
/// All clusters together.
Count SumOf(std::span<const Count> clusters);

/// Score interval without continuity correction (Wilson 1927). The default of every rate that is shown.
Estimate WilsonInterval(std::int64_t successes, std::int64_t trials, double confidence = 0.95);

/// "Exact": covers at least `confidence` whatever the rate (Clopper & Pearson 1934). For gates that promise coverage.
Estimate ClopperPearsonInterval(std::int64_t successes, std::int64_t trials, double confidence = 0.95);

/// Equal-tailed Beta(k + 1/2, n - k + 1/2), its low end 0 at k = 0 and its high end 1 at k = n (Brown, Cai & DasGupta
/// 2001).
Estimate JeffreysInterval(std::int64_t successes, std::int64_t trials, double confidence = 0.95);

/// p ± sqrt(ln(2 / alpha) / 2n), clipped to [0, 1] (Hoeffding 1963): needs nothing but independence, and is wide.
Estimate HoeffdingInterval(std::int64_t successes, std::int64_t trials, double confidence = 0.95);

/// What repeats within one cluster (the same initial state, several seeds) tell about a rate.
struct ClusterStatistics {
  Number rate = Undefined{"no trials"};  ///< pooled: sum of successes / sum of trials
  Number icc = Undefined{"no trials"};   ///< ICC(1) by one-way ANOVA; below 0 where clusters are more alike than chance
  Number design_effect = Undefined{"no trials"};     ///< 1 + (m - 1) ICC, m the size of the cluster a trial is in, on
                                                     ///< average: sum n² / sum n
  Number effective_trials = Undefined{"no trials"};  ///< trials / design effect, at most trials; of repeats that cannot
                                                     ///< show it (one cluster, all outcomes equal), their clusters
  Number cluster_se = Undefined{"no trials"};        ///< of the rate: linearised ratio, with G / (G - 1)
  Number naive_se = Undefined{"no trials"};          ///< as if all trials were independent
  std::int64_t clusters = 0, trials = 0;
};
/// Clusters without trials are left out.
ClusterStatistics StatisticsOfClusters(std::span<const Count> clusters);

/// Wilson on the effective number of trials; plain Wilson where that is undefined (one trial per cluster).
Estimate ClusteredWilsonInterval(std::span<const Count> clusters, double confidence = 0.95);

/// Successes and trials that need not be whole numbers.
struct Weighted {
  double successes = 0, trials = 0;
};
/// The effective trials, at least 1, with the clusters' rate. As they are where no cluster has more than one trial.
Weighted EffectiveTrials(std::span<const Count> clusters);

/// The effective trials as a count, for tests of whole numbers: rounded down, at least 1, with the clusters' rate. As
/// they are where no cluster has more than one trial.
Count EffectiveCount(std::span<const Count> clusters);

/// How many trials or pairs there are, and how many independent ones would tell as much.
struct Repeated {
  std::int64_t all = 0, effective = 0;
};

}  // namespace evac
