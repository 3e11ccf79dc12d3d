#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

/// Intervals by resampling. Draws come from SplitMix64(seed).Below(n) in a fixed order: the same numbers everywhere.
namespace evac {

/// Quantiles by linear interpolation of the order statistics (Hyndman & Fan's type 7; numpy's and R's default).
/// @param sorted  ascending, not empty. @param probability in [0, 1].
double Quantile(std::span<const double> sorted, double probability);

/// How the statistic scattered when the data were resampled.
struct Resampled {
  double theta = 0;                ///< the statistic of the data as they are
  std::vector<double> replicates;  ///< of resampled data, those undefined left out
  std::vector<double> jackknife;   ///< of the data with one unit left out, those undefined left out
};

struct BootstrapIntervals {
  Defined<Interval> percentile = Undefined{"no replicates"};  ///< type-7 quantiles of the replicates
  Defined<Interval> basic = Undefined{"no replicates"};       ///< 2 theta - them
  Defined<Interval> bca = Undefined{"no replicates"};  ///< bias-corrected and accelerated (Efron 1987); undefined where
                                                       ///< all replicates lie on one side of theta
  Number z0 = Undefined{"no replicates"};              ///< Phi^-1((#less + #leq) / 2B)
  Number acceleration = Undefined{"no replicates"};    ///< from the jackknife; 0 where that does not scatter
};
/// @throws InvalidInput unless 0 < confidence < 1.
BootstrapIntervals IntervalsOf(const Resampled& resampled, double confidence = 0.95);

struct BootstrapOptions {
  int replicates = 2000;
  std::uint64_t seed = 0;
  double confidence = 0.95;
};

/// The pooled rate when whole clusters are drawn with replacement. @throws InvalidInput if no cluster has a trial.
Resampled ClusterBootstrapRate(std::span<const Count> clusters, const BootstrapOptions& options = {});

}  // namespace evac
