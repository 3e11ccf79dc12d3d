#include "core/statistics/betting.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

void Check(std::span<const double> values, const BettingOptions& options) {
  for (const double value : values) {
    if (!(value >= 0 && value <= 1)) throw InvalidInput("statistics: a value of {}, wanted 0 <= value <= 1", value);
  }
  if (!(options.confidence > 0 && options.confidence < 1)) {
    throw InvalidInput("statistics: confidence is {}, wanted 0 < confidence < 1", options.confidence);
  }
  if (!(options.truncation > 0 && options.truncation <= 1) || !(options.share > 0 && options.share < 1)) {
    throw InvalidInput("statistics: truncation {} and share {}, wanted both in (0, 1)", options.truncation,
                       options.share);
  }
}

/// lambda_t = sqrt(2 ln(2 / alpha) / (n sigma²_{t-1})), from the values before t.
std::vector<double> Bets(std::span<const double> values, double alpha) {
  const double n = static_cast<double>(values.size());
  double sum = 0.5, squares = 0.25, t = 0;
  std::vector<double> bets;
  for (const double value : values) {
    const double variance = squares / (t + 1);
    bets.push_back(std::sqrt(2 * std::log(2 / alpha) / (n * variance)));
    ++t;
    sum += value;
    const double mean = sum / (t + 1);
    squares += (value - mean) * (value - mean);
  }
  return bets;
}

/// The log of the money after betting that the mean of `values` is above m.
double LogCapital(std::span<const double> values, std::span<const double> bets, double m, double truncation) {
  double log_capital = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    log_capital += std::log1p(std::min(bets[i], truncation / m) * (values[i] - m));
  }
  return log_capital;
}

/// The largest m in [0, 1] that a bet on "above m" refutes, and 0 if none: its money falls as m grows.
double LowerEnd(std::span<const double> values, std::span<const double> bets, double log_limit, double truncation) {
  const auto is_refuted = [&](double m) { return LogCapital(values, bets, m, truncation) >= log_limit; };
  if (!is_refuted(0)) return 0;
  double refuted = 0, open = 1;
  for (int halving = 0; halving < 64; ++halving) {
    const double middle = (refuted + open) / 2;
    (is_refuted(middle) ? refuted : open) = middle;
  }
  return (refuted + open) / 2;
}

}  // namespace

Estimate BettingInterval(std::span<const double> values, const BettingOptions& options) {
  Check(values, options);
  Estimate mean;
  mean.method = "betting";
  mean.confidence = options.confidence;
  mean.n = static_cast<std::int64_t>(values.size());
  mean.value = Undefined{"no values"};
  mean.interval = Interval{0, 1};
  if (values.empty()) return mean;

  mean.value = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  const double alpha = 1 - options.confidence;
  const std::vector<double> bets = Bets(values, alpha);
  std::vector<double> mirrored;  // a bet on "below m" is one on "above 1 - m" of 1 - x
  for (const double value : values) mirrored.push_back(1 - value);
  const double low = LowerEnd(values, bets, -std::log(alpha * options.share), options.truncation);
  const double high = 1 - LowerEnd(mirrored, bets, -std::log(alpha * (1 - options.share)), options.truncation);
  mean.interval = Undefined{"every mean is refuted: the values drift"};
  if (low <= high) mean.interval = Interval{low, high};
  return mean;
}

std::vector<double> SeededShuffle(std::span<const double> values, std::uint64_t seed) {
  std::vector<double> shuffled(values.begin(), values.end());
  SplitMix64 random(seed);
  for (std::size_t left = shuffled.size(); left > 1; --left)
    std::swap(shuffled[left - 1], shuffled[random.Below(left)]);
  return shuffled;
}

}  // namespace evac
