#include "core/statistics/rate_difference.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

constexpr double kRounding = 1e-9;  // 5.999… pairs are 6

void Check(const PairedOutcomes& outcomes) {
  const auto [b, c] = outcomes.flips;
  if (b < 0 || c < 0 || b + c > outcomes.pairs) {
    throw InvalidInput("statistics: {} and {} discordant of {} pairs, wanted 0 <= both and their sum <= pairs", b, c,
                       outcomes.pairs);
  }
}

/// The difference without its interval yet.
Estimate PairedDifference(const PairedOutcomes& outcomes, double confidence) {
  Check(outcomes);
  TwoSidedZ(confidence);  // complains
  Estimate difference;
  difference.confidence = confidence;
  difference.n = outcomes.pairs;
  difference.interval = Interval{-1, 1};
  difference.value = Undefined{"no pairs"};
  if (outcomes.pairs > 0) {
    difference.value = static_cast<double>(outcomes.flips.only_first - outcomes.flips.only_second) /
                       static_cast<double>(outcomes.pairs);
  }
  return difference;
}

/// Outcomes that need not be whole numbers.
struct WeightedPairs {
  explicit WeightedPairs(const PairedOutcomes& outcomes, double weight = 1)
      : only_first(weight * static_cast<double>(outcomes.flips.only_first)),
        only_second(weight * static_cast<double>(outcomes.flips.only_second)),
        pairs(weight * static_cast<double>(outcomes.pairs)) {}
  double Difference() const { return (only_first - only_second) / pairs; }
  double only_first, only_second, pairs;
};

/// Tango's score statistic of "the difference is delta"; falls as delta grows. The share of (failure, success) pairs
/// takes its most likely value under that hypothesis, the root of A q² + B q + C.
double TangoScore(const WeightedPairs& outcomes, double delta) {
  const auto [b, c, n] = outcomes;
  const double linear = -b - c + (2 * n - b + c) * delta, constant = -c * delta * (1 - delta);
  const double root = std::sqrt(std::max(0.0, linear * linear - 8 * n * constant));
  // The two forms are equal; each cancels where the other does not.
  const double q = linear <= 0 ? (root - linear) / (4 * n) : -2 * constant / (root + linear);
  const double variance = n * (2 * q + delta * (1 - delta));
  const double distance = b - c - n * delta;
  if (variance <= 0) return distance == 0 ? 0 : std::copysign(INFINITY, distance);
  return distance / std::sqrt(variance);
}

/// Where the falling score crosses `target` within [low, high], to the last bit.
double CrossingOf(const WeightedPairs& outcomes, double target, Interval within) {
  for (int halving = 0; halving < 64; ++halving) {
    const double middle = (within.low + within.high) / 2;
    (TangoScore(outcomes, middle) > target ? within.low : within.high) = middle;
  }
  return (within.low + within.high) / 2;
}

/// @param outcomes  with pairs above 0
Interval TangoInterval(const WeightedPairs& outcomes, double confidence) {
  const double value = outcomes.Difference(), z = TwoSidedZ(confidence);
  Interval interval{-1, 1};
  if (value > -1) interval.low = CrossingOf(outcomes, z, {-1, value});
  if (value < 1) interval.high = CrossingOf(outcomes, -z, {value, 1});
  return interval;
}

std::int64_t ClustersWithPairs(std::span<const PairedOutcomes> clusters) {
  return std::ranges::count_if(clusters, [](const PairedOutcomes& cluster) { return cluster.pairs > 0; });
}

/// The number of pairs at which a score interval of the share that differs from the rest ends where that of none ends,
/// z² / (clusters + z²), of one pair per cluster; infinite where the share itself lies beyond.
double PairsVouchedFor(const PairedOutcomes& all, std::int64_t clusters, double confidence) {
  const auto [b, c] = all.flips;
  const double differing = static_cast<double>(all.pairs - std::max({b, c, all.pairs - b - c}));
  const double groups = static_cast<double>(clusters), z = TwoSidedZ(confidence);
  const double share = differing / static_cast<double>(all.pairs), end_of_none = z * z / (groups + z * z);
  if (share >= end_of_none) return INFINITY;
  return groups / std::pow(1 - share / end_of_none, 2);
}

/// What the interval rests on: whole numbers where EffectivePairs are that, else all pairs in proportion.
WeightedPairs BasisOf(std::span<const PairedOutcomes> clusters, double confidence) {
  const PairedOutcomes all = SumOf(clusters), effective = EffectivePairs(clusters);
  if (all.pairs == 0) return WeightedPairs(all);
  const double vouched = PairsVouchedFor(all, ClustersWithPairs(clusters), confidence);
  if (vouched >= static_cast<double>(effective.pairs)) return WeightedPairs(effective);
  return WeightedPairs(all, vouched / static_cast<double>(all.pairs));
}

}  // namespace

Estimate NewcombeDifference(const Count& first, const Count& second, double confidence) {
  return NewcombeOfRates(WilsonInterval(first.successes, first.trials, confidence),
                         WilsonInterval(second.successes, second.trials, confidence));
}

Estimate NewcombeOfRates(const Estimate& one, const Estimate& two) {
  Estimate difference;
  difference.method = "Newcombe";
  difference.confidence = one.confidence;
  difference.n = one.n + two.n;
  difference.interval = Interval{-1, 1};
  difference.value = Undefined{"no trials"};
  if (!one.value || !two.value) return difference;
  const double value = *one.value - *two.value;
  difference.value = value;
  difference.interval = Interval{value - std::hypot(*one.value - one.interval->low, two.interval->high - *two.value),
                                 value + std::hypot(one.interval->high - *one.value, *two.value - two.interval->low)};
  return difference;
}

Estimate TangoDifference(const PairedOutcomes& outcomes, double confidence) {
  Estimate difference = PairedDifference(outcomes, confidence);
  difference.method = "Tango";
  if (!difference.value) return difference;
  difference.interval = TangoInterval(WeightedPairs(outcomes), confidence);
  return difference;
}

PairedOutcomes SumOf(std::span<const PairedOutcomes> clusters) {
  PairedOutcomes total;
  for (const PairedOutcomes& cluster : clusters) {
    Check(cluster);
    total.pairs += cluster.pairs;
    total.flips.only_first += cluster.flips.only_first;
    total.flips.only_second += cluster.flips.only_second;
  }
  return total;
}

PairedOutcomes EffectivePairs(std::span<const PairedOutcomes> clusters) {
  const PairedOutcomes total = SumOf(clusters);
  const double groups = static_cast<double>(ClustersWithPairs(clusters));
  const double n = static_cast<double>(total.pairs), b = static_cast<double>(total.flips.only_first),
               c = static_cast<double>(total.flips.only_second);
  if (groups == n) return total;
  const double mean = (b - c) / n, spread = b + c - n * mean * mean;  // n times the variance of one pair
  double residuals = 0;  // linearised, as of a ratio
  for (const PairedOutcomes& cluster : clusters) {
    const double difference = static_cast<double>(cluster.flips.only_first - cluster.flips.only_second);
    const double residual = difference - mean * static_cast<double>(cluster.pairs);
    residuals += residual * residual;
  }
  const bool is_seen = groups > 1 && spread > 0;
  const double design_effect = is_seen ? std::max(1.0, groups / (groups - 1) * residuals / spread) : n / groups;
  const auto shrunk = [&](std::int64_t count) { return std::llround(static_cast<double>(count) / design_effect); };
  const Flips flips{shrunk(total.flips.only_first), shrunk(total.flips.only_second)};
  return {flips, std::max<std::int64_t>({1, shrunk(total.pairs), flips.only_first + flips.only_second})};
}

Estimate TangoOfClusters(std::span<const PairedOutcomes> clusters, double confidence) {
  Estimate difference = PairedDifference(SumOf(clusters), confidence);
  difference.method = "Tango";
  if (difference.value) difference.interval = TangoInterval(BasisOf(clusters, confidence), confidence);
  return difference;
}

Number PairsUntilTangoLeavesOut(double limit, const PairedOutcomes& outcomes, double confidence) {
  const Estimate difference = PairedDifference(outcomes, confidence);
  if (!(limit > -1 && limit < 1)) throw InvalidInput("statistics: limit is {}, wanted -1 < limit < 1", limit);
  if (!difference.value) return Undefined{difference.value.reason()};
  const double score = TangoScore(WeightedPairs(outcomes), limit), z = TwoSidedZ(confidence);
  if (score == 0) return Undefined{"the difference is the limit"};
  return static_cast<double>(outcomes.pairs) * z * z / (score * score);
}

Repeated PairsOfInterval(std::span<const PairedOutcomes> clusters, double confidence) {
  const double pairs = BasisOf(clusters, confidence).pairs;
  return {SumOf(clusters).pairs, static_cast<std::int64_t>(std::floor(pairs + kRounding))};
}

Estimate BonettPriceDifference(const PairedOutcomes& outcomes, double confidence) {
  Estimate difference = PairedDifference(outcomes, confidence);
  difference.method = "Bonett-Price";
  if (!difference.value) return difference;
  const double n = static_cast<double>(outcomes.pairs) + 2;
  const double b = (static_cast<double>(outcomes.flips.only_first) + 1) / n,
               c = (static_cast<double>(outcomes.flips.only_second) + 1) / n;
  const double half_width = TwoSidedZ(confidence) * std::sqrt((b + c - (b - c) * (b - c)) / n);
  difference.interval = Interval{std::max(-1.0, b - c - half_width), std::min(1.0, b - c + half_width)};
  return difference;
}

Interval MoverSum(const Estimate& theta, const Estimate& delta) {
  const double sum = *theta.value + *delta.value;
  return {sum - std::hypot(*theta.value - theta.interval->low, *delta.value - delta.interval->low),
          sum + std::hypot(theta.interval->high - *theta.value, delta.interval->high - *delta.value)};
}

}  // namespace evac
