#include "core/statistics/rate_difference.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

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

/// Tango's score statistic of "the difference is delta"; falls as delta grows. The share of (failure, success) pairs
/// takes its most likely value under that hypothesis, the root of A q² + B q + C.
double TangoScore(const PairedOutcomes& outcomes, double delta) {
  const double n = static_cast<double>(outcomes.pairs), b = static_cast<double>(outcomes.flips.only_first),
               c = static_cast<double>(outcomes.flips.only_second);
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
double CrossingOf(const PairedOutcomes& outcomes, double target, Interval within) {
  for (int halving = 0; halving < 64; ++halving) {
    const double middle = (within.low + within.high) / 2;
    (TangoScore(outcomes, middle) > target ? within.low : within.high) = middle;
  }
  return (within.low + within.high) / 2;
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
  const double value = *difference.value, z = TwoSidedZ(confidence);
  Interval interval{-1, 1};
  if (value > -1) interval.low = CrossingOf(outcomes, z, {-1, value});
  if (value < 1) interval.high = CrossingOf(outcomes, -z, {value, 1});
  difference.interval = interval;
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
  double groups = 0;
  for (const PairedOutcomes& cluster : clusters) groups += cluster.pairs > 0;
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

Estimate TangoOfClusters(const PairedOutcomes& all, const PairedOutcomes& effective, double confidence) {
  Estimate difference = TangoDifference(effective, confidence);
  difference.value = TangoDifference(all, confidence).value;
  difference.n = all.pairs;
  return difference;
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
