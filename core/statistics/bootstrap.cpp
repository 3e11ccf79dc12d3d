#include "core/statistics/bootstrap.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

Number BiasCorrection(const Resampled& resampled, std::span<const double> sorted) {
  const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), resampled.theta);
  const double less = static_cast<double>(first - sorted.begin()), leq = static_cast<double>(last - sorted.begin());
  const double share = (less + leq) / (2 * static_cast<double>(sorted.size()));
  if (share == 0 || share == 1) return Undefined{"all replicates lie on one side of the estimate"};
  return NormalQuantile(share);
}

/// Sum d³ / (6 (sum d²)^1.5), d = mean - jackknife value.
Number Acceleration(std::span<const double> jackknife) {
  if (jackknife.empty()) return Undefined{"no jackknife values"};
  if (std::ranges::min(jackknife) == std::ranges::max(jackknife)) return 0.0;
  const double mean = std::accumulate(jackknife.begin(), jackknife.end(), 0.0) / static_cast<double>(jackknife.size());
  double squares = 0, cubes = 0;
  for (const double value : jackknife) {
    const double d = mean - value;
    squares += d * d;
    cubes += d * d * d;
  }
  return Finite(cubes / (6 * std::pow(squares, 1.5)));
}

/// The probability at which BCa reads the replicates instead of that with normal quantile z.
double Shifted(double z, double z0, double acceleration) {
  return NormalCdf(z0 + (z0 + z) / (1 - acceleration * (z0 + z)));
}

Defined<Interval> BcaInterval(const BootstrapIntervals& so_far, std::span<const double> sorted, double confidence) {
  if (!so_far.z0) return Undefined{so_far.z0.reason()};
  if (!so_far.acceleration) return Undefined{so_far.acceleration.reason()};
  const double z = TwoSidedZ(confidence);
  const double low = Shifted(-z, *so_far.z0, *so_far.acceleration), high = Shifted(z, *so_far.z0, *so_far.acceleration);
  return Interval{Quantile(sorted, std::min(low, high)), Quantile(sorted, std::max(low, high))};
}

double PooledRate(const Count& total) {
  return static_cast<double>(total.successes) / static_cast<double>(total.trials);
}

}  // namespace

double Quantile(std::span<const double> sorted, double probability) {
  if (sorted.empty()) throw InvalidInput("statistics: a quantile of no values");
  if (!(probability >= 0 && probability <= 1)) {
    throw InvalidInput("statistics: probability is {}, wanted 0 <= p <= 1", probability);
  }
  const double place = probability * static_cast<double>(sorted.size() - 1);
  const std::size_t below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

BootstrapIntervals IntervalsOf(const Resampled& resampled, double confidence) {
  const double tail = (1 - confidence) / 2;
  if (!(tail > 0 && tail < 0.5)) {
    throw InvalidInput("statistics: confidence is {}, wanted 0 < confidence < 1", confidence);
  }
  BootstrapIntervals result;
  if (resampled.replicates.empty()) return result;
  std::vector<double> sorted = resampled.replicates;
  std::ranges::sort(sorted);
  const Interval percentile{Quantile(sorted, tail), Quantile(sorted, 1 - tail)};
  result.percentile = percentile;
  result.basic = Interval{2 * resampled.theta - percentile.high, 2 * resampled.theta - percentile.low};
  result.z0 = BiasCorrection(resampled, sorted);
  result.acceleration = Acceleration(resampled.jackknife);
  result.bca = BcaInterval(result, sorted, confidence);
  return result;
}

Resampled ClusterBootstrapRate(std::span<const Count> clusters, const BootstrapOptions& options) {
  Count total;
  for (const Count& cluster : clusters) {
    total.successes += cluster.successes;
    total.trials += cluster.trials;
  }
  if (total.trials == 0) throw InvalidInput("statistics: a cluster bootstrap of no trials");
  if (options.replicates < 1) throw InvalidInput("statistics: {} replicates, wanted at least 1", options.replicates);

  Resampled result;
  result.theta = PooledRate(total);
  SplitMix64 random(options.seed);
  for (int replicate = 0; replicate < options.replicates; ++replicate) {
    Count drawn;
    for (std::size_t draw = 0; draw < clusters.size(); ++draw) {
      const Count& cluster = clusters[random.Below(clusters.size())];
      drawn.successes += cluster.successes;
      drawn.trials += cluster.trials;
    }
    if (drawn.trials > 0) result.replicates.push_back(PooledRate(drawn));
  }
  for (const Count& left_out : clusters) {
    const Count rest{total.successes - left_out.successes, total.trials - left_out.trials};
    if (rest.trials > 0) result.jackknife.push_back(PooledRate(rest));
  }
  return result;
}

}  // namespace evac
