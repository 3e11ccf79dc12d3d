#include "core/statistics/rates.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

constexpr double kRounding = 1e-9;  // an effective 5.999… is a 6

/// The rate without its interval yet.
Estimate Rate(std::int64_t successes, std::int64_t trials, double confidence) {
  CheckCount({successes, trials});
  if (!(confidence > 0 && confidence < 1)) {
    throw InvalidInput("statistics: confidence is {}, wanted 0 < confidence < 1", confidence);
  }
  Estimate rate;
  rate.n = trials;
  rate.confidence = confidence;
  rate.interval = Interval{0, 1};
  rate.value = Undefined{"no trials"};
  if (trials > 0) rate.value = static_cast<double>(successes) / static_cast<double>(trials);
  return rate;
}

/// Wilson's interval of a rate p from n trials; n need not be whole (effective trials).
Interval Wilson(double p, double n, double confidence) {
  const double z = TwoSidedZ(confidence);
  const double centre = p + z * z / (2 * n);
  const double half_width = z * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  const double scale = 1 + z * z / n;
  const double low = p == 0 ? 0 : (centre - half_width) / scale;  // exact at the ends, where it cancels
  const double high = p == 1 ? 1 : (centre + half_width) / scale;
  return {std::clamp(low, 0.0, 1.0), std::clamp(high, 0.0, 1.0)};
}

std::vector<Count> WithTrials(std::span<const Count> clusters) {
  std::vector<Count> kept;
  for (const Count& cluster : clusters) {
    CheckCount(cluster);
    if (cluster.trials > 0) kept.push_back(cluster);
  }
  return kept;
}

/// ICC(1) = (MSB - MSW) / (MSB + (m - 1) MSW) of 0/1 outcomes; m is the ANOVA's average size, the size where all are
/// equal.
Number AnovaIcc(std::span<const Count> clusters, double rate, double average_size) {
  const double groups = static_cast<double>(clusters.size());
  const double trials = static_cast<double>(SumOf(clusters).trials);
  if (groups < 2) return Undefined{"fewer than 2 clusters"};
  if (trials == groups) return Undefined{"no cluster has more than one trial"};
  double between = 0, within = 0;
  for (const Count& cluster : clusters) {
    const double n = static_cast<double>(cluster.trials), p = static_cast<double>(cluster.successes) / n;
    between += n * (p - rate) * (p - rate);
    within += n * p * (1 - p);
  }
  const double mean_between = between / (groups - 1), mean_within = within / (trials - groups);
  const double denominator = mean_between + (average_size - 1) * mean_within;
  if (denominator == 0) return Undefined{"all outcomes are equal"};
  return (mean_between - mean_within) / denominator;
}

double Trials(std::span<const Count> clusters) {
  double trials = 0;
  for (const Count& cluster : clusters) trials += static_cast<double>(cluster.trials);
  return trials;
}

/// How many trials the cluster has that a trial is in, on average: what the variance of the pooled rate grows with. The
/// size where all are equal; more than the plain mean where they are not.
double SizeAsTrialsSeeIt(std::span<const Count> clusters) {
  double squares = 0;
  for (const Count& cluster : clusters)
    squares += static_cast<double>(cluster.trials) * static_cast<double>(cluster.trials);
  return squares / Trials(clusters);
}

double AverageClusterSize(std::span<const Count> clusters) {
  return (Trials(clusters) - SizeAsTrialsSeeIt(clusters)) / (static_cast<double>(clusters.size()) - 1);
}

double LinearisedSe(std::span<const Count> clusters, double rate) {
  double residuals = 0, trials = 0;
  for (const Count& cluster : clusters) {
    const double n = static_cast<double>(cluster.trials);
    const double residual = static_cast<double>(cluster.successes) - rate * n;
    residuals += residual * residual;
    trials += n;
  }
  const double groups = static_cast<double>(clusters.size());
  return std::sqrt(groups / (groups - 1) * residuals) / trials;
}

}  // namespace

void CheckCount(const Count& count) {
  if (count.trials < 0 || count.successes < 0 || count.successes > count.trials) {
    throw InvalidInput("statistics: {} successes of {} trials, wanted 0 <= successes <= trials", count.successes,
                       count.trials);
  }
}

Count SumOf(std::span<const Count> clusters) {
  Count total;
  for (const Count& cluster : clusters) {
    total.successes += cluster.successes;
    total.trials += cluster.trials;
  }
  return total;
}

Estimate WilsonInterval(std::int64_t successes, std::int64_t trials, double confidence) {
  Estimate rate = Rate(successes, trials, confidence);
  rate.method = "Wilson";
  if (rate.value) rate.interval = Wilson(*rate.value, static_cast<double>(trials), confidence);
  return rate;
}

Estimate ClopperPearsonInterval(std::int64_t successes, std::int64_t trials, double confidence) {
  Estimate rate = Rate(successes, trials, confidence);
  rate.method = "Clopper-Pearson";
  const double k = static_cast<double>(successes), n = static_cast<double>(trials), tail = (1 - confidence) / 2;
  Interval interval;
  if (successes > 0) interval.low = BetaQuantile(tail, k, n - k + 1);
  if (successes < trials) interval.high = BetaQuantile(1 - tail, k + 1, n - k);
  if (trials > 0) rate.interval = interval;
  return rate;
}

Estimate JeffreysInterval(std::int64_t successes, std::int64_t trials, double confidence) {
  Estimate rate = Rate(successes, trials, confidence);
  rate.method = "Jeffreys";
  const double k = static_cast<double>(successes), n = static_cast<double>(trials), tail = (1 - confidence) / 2;
  Interval interval;
  if (successes > 0) interval.low = BetaQuantile(tail, k + 0.5, n - k + 0.5);
  if (successes < trials) interval.high = BetaQuantile(1 - tail, k + 0.5, n - k + 0.5);
  if (trials > 0) rate.interval = interval;
  return rate;
}

Estimate HoeffdingInterval(std::int64_t successes, std::int64_t trials, double confidence) {
  Estimate rate = Rate(successes, trials, confidence);
  rate.method = "Hoeffding";
  if (!rate.value) return rate;
  const double half_width = std::sqrt(std::log(2 / (1 - confidence)) / (2 * static_cast<double>(trials)));
  rate.interval = Interval{std::max(0.0, *rate.value - half_width), std::min(1.0, *rate.value + half_width)};
  return rate;
}

ClusterStatistics StatisticsOfClusters(std::span<const Count> all_clusters) {
  const std::vector<Count> clusters = WithTrials(all_clusters);
  const Count total = SumOf(clusters);
  ClusterStatistics result;
  result.clusters = static_cast<std::int64_t>(clusters.size());
  result.trials = total.trials;
  if (clusters.empty()) return result;

  const double trials = static_cast<double>(total.trials);
  const double rate = static_cast<double>(total.successes) / trials;
  result.rate = rate;
  result.naive_se = std::sqrt(rate * (1 - rate) / trials);
  result.icc = result.design_effect = result.effective_trials = result.cluster_se = Undefined{"fewer than 2 clusters"};
  const bool has_repeats = result.trials > result.clusters;
  if (has_repeats) result.effective_trials = static_cast<double>(result.clusters);  // nothing shows yet that it is more
  if (clusters.size() < 2) return result;

  result.cluster_se = LinearisedSe(clusters, rate);
  result.icc = AnovaIcc(clusters, rate, AverageClusterSize(clusters));
  result.design_effect = Undefined{result.icc.reason()};
  if (!has_repeats) result.effective_trials = Undefined{result.icc.reason()};
  if (!result.icc) return result;
  const double design_effect = 1 + (SizeAsTrialsSeeIt(clusters) - 1) * *result.icc;
  result.design_effect = design_effect;
  result.effective_trials = trials / std::max(design_effect, 1.0);
  return result;
}

Estimate ClusteredWilsonInterval(std::span<const Count> clusters, double confidence) {
  const ClusterStatistics statistics = StatisticsOfClusters(clusters);
  const Count total = SumOf(clusters);
  Estimate rate = WilsonInterval(total.successes, total.trials, confidence);
  if (!statistics.effective_trials) return rate;
  rate.interval = Wilson(*rate.value, *statistics.effective_trials, confidence);
  rate.method = "Wilson on effective trials";
  return rate;
}

Weighted EffectiveTrials(std::span<const Count> clusters) {
  const ClusterStatistics statistics = StatisticsOfClusters(clusters);
  const Count all = SumOf(clusters);
  if (!statistics.effective_trials) return {static_cast<double>(all.successes), static_cast<double>(all.trials)};
  const double trials = std::max(1.0, *statistics.effective_trials);
  return {*statistics.rate * trials, trials};
}

Count EffectiveCount(std::span<const Count> clusters) {
  if (!StatisticsOfClusters(clusters).effective_trials) return SumOf(clusters);
  const auto [successes, trials] = EffectiveTrials(clusters);
  const double whole = std::floor(trials + kRounding);
  return {std::llround(successes / trials * whole), static_cast<std::int64_t>(whole)};
}

}  // namespace evac
