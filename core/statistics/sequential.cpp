#include "core/statistics/sequential.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

double Likelihood(double p, bool success) { return success ? p : 1 - p; }

/// The factor by which a bet on "first below second" grows. Where the estimates say the opposite, nothing is bet.
double Growth(double first_rate, double second_rate, bool first, bool second) {
  if (first_rate >= second_rate) return 1;
  const double null = (first_rate + second_rate) / 2;
  return Likelihood(first_rate, first) * Likelihood(second_rate, second) /
         (Likelihood(null, first) * Likelihood(null, second));
}

/// Bisection for where `is_inside` ends, from a point inside towards one outside.
template <typename IsInside>
double EdgeOf(double inside, double outside, IsInside is_inside) {
  for (int halving = 0; halving < 64; ++halving) {
    const double middle = (inside + outside) / 2;
    (is_inside(middle) ? inside : outside) = middle;
  }
  return (inside + outside) / 2;
}

}  // namespace

void TwoRatesBet::Add(bool first, bool second) {
  const double low_first = (1 + first_) / (3 + steps_), high_first = (2 + first_) / (3 + steps_);
  const double low_second = (1 + second_) / (3 + steps_), high_second = (2 + second_) / (3 + steps_);
  below_ *= Growth(low_first, high_second, first, second);
  above_ *= Growth(low_second, high_first, second, first);
  first_ += first ? 1 : 0;
  second_ += second ? 1 : 0;
  ++steps_;
}

double TwoRatesBet::e_value() const {
  switch (alternative_) {
    case RateOrder::kFirstBelow:
      return below_;
    case RateOrder::kFirstAbove:
      return above_;
    case RateOrder::kEither:
      return (below_ + above_) / 2;
  }
  return 1;
}

void FlipsBet::Add(bool first, bool second) {
  only_first_ += first && !second;
  only_second_ += second && !first;
}

double FlipsBet::e_value() const { return FlipsEValue(only_first_, only_second_); }

double FlipsEValue(std::int64_t only_first, std::int64_t only_second) {
  if (std::min(only_first, only_second) < 0) {
    throw InvalidInput("statistics: {} and {} discordant pairs, wanted none below 0", only_first, only_second);
  }
  const double b = static_cast<double>(only_first), c = static_cast<double>(only_second);
  const double e_value = std::exp((b + c) * std::log(2.0) + LogBeta(0.5 + b, 0.5 + c) - LogBeta(0.5, 0.5));
  return std::min(e_value, std::numeric_limits<double>::max());  // smaller is an e-value too; JSON has no infinity
}

SequentialTest TwoRatesSequential(const std::vector<bool>& first, const std::vector<bool>& second,
                                  RateOrder alternative, double alpha) {
  if (first.size() != second.size()) {
    throw InvalidInput("statistics: sequences of {} and {} outcomes, wanted the same length", first.size(),
                       second.size());
  }
  if (!(alpha > 0 && alpha < 1)) throw InvalidInput("statistics: alpha is {}, wanted 0 < alpha < 1", alpha);
  SequentialTest test;
  TwoRatesBet bet(alternative);
  double largest = 1;
  for (std::size_t i = 0; i < first.size(); ++i) {
    bet.Add(first[i], second[i]);
    largest = std::max(largest, bet.e_value());
    test.e_values.push_back(bet.e_value());
    test.p_values.push_back(1 / largest);
    if (!test.first_reject && test.p_values.back() <= alpha) test.first_reject = static_cast<std::int64_t>(i) + 1;
  }
  return test;
}

Estimate ConfidenceSequence(const Count& count, double confidence, const MixturePrior& prior) {
  Estimate rate = WilsonInterval(count.successes, count.trials, confidence);  // its checks, value and n
  rate.method = "Beta-binomial confidence sequence";
  const double k = static_cast<double>(count.successes), n = static_cast<double>(count.trials), f = n - k;
  const double log_mixture = LogBeta(prior.a + k, prior.b + f) - LogBeta(prior.a, prior.b);
  const auto is_inside = [&](double p) {
    const double log_likelihood = (k == 0 ? 0 : k * std::log(p)) + (f == 0 ? 0 : f * std::log1p(-p));
    return log_mixture < log_likelihood - std::log(1 - confidence);
  };
  if (!rate.value) return rate;
  Interval interval{0, 1};
  if (!is_inside(0)) interval.low = EdgeOf(*rate.value, 0, is_inside);
  if (!is_inside(1)) interval.high = EdgeOf(*rate.value, 1, is_inside);
  rate.interval = interval;
  return rate;
}

Estimate SequentialPairedDifference(const PairedOutcomes& outcomes, double confidence) {
  const auto sequence = [&](std::int64_t flips) {
    return ConfidenceSequence({flips, outcomes.pairs}, 1 - (1 - confidence) / 2);
  };
  const Estimate first = sequence(outcomes.flips.only_first), second = sequence(outcomes.flips.only_second);
  Estimate difference;
  difference.method = "two Beta-binomial confidence sequences";
  difference.confidence = confidence;
  difference.n = outcomes.pairs;
  difference.value = Undefined{"no pairs"};
  difference.interval = Interval{-1, 1};
  if (!first.value || !second.value) return difference;
  difference.value = *first.value - *second.value;
  difference.interval = Interval{first.interval->low - second.interval->high, first.interval->high - second.interval->low};
  return difference;
}

}  // namespace evac
