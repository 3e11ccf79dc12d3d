#include "core/statistics/planning.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/statistics/hypergeometric.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

/// p <= alpha for p-values that may equal alpha exactly but for rounding.
constexpr double kRounding = 1e-12;
constexpr double kMostTrials = 0x1.0p62;

void RequireShare(double share, const char* name) {
  if (!(share >= 0 && share <= 1)) throw InvalidInput("statistics: {} is {}, wanted 0 <= {} <= 1", name, share, name);
}

void RequireInside(double share, const char* name) {
  if (!(share > 0 && share < 1)) throw InvalidInput("statistics: {} is {}, wanted 0 < {} < 1", name, share, name);
}

void Check(const Promise& promise) {
  RequireInside(promise.alpha, "alpha");
  RequireInside(promise.power, "power");
}

SampleSize RoundedUp(double exact) {
  if (!(exact < kMostTrials)) return {.exact = Undefined{"more than can be counted"}, .n = 0};
  return {.exact = exact, .n = static_cast<std::int64_t>(std::ceil(exact - 1e-9))};
}

double TwoSided(const Promise& promise) { return TwoSidedZ(1 - promise.alpha); }
double OneSidedSum(const Promise& promise) { return NormalQuantile(1 - promise.alpha) + NormalQuantile(promise.power); }

/// (z_alpha sqrt(2 p q) + z_power sqrt(p1 q1 + p2 q2))² / (p1 - p2)², p the mean.
double PerArm(double p1, double p2, const Promise& promise) {
  const double mean = (p1 + p2) / 2;
  const double root = TwoSided(promise) * std::sqrt(2 * mean * (1 - mean)) +
                      NormalQuantile(promise.power) * std::sqrt(p1 * (1 - p1) + p2 * (1 - p2));
  return root * root / ((p1 - p2) * (p1 - p2));
}

double ExactMcNemarP(std::int64_t b, std::int64_t flips) {
  const std::int64_t least = std::min(b, flips - b);
  return flips == 0 ? 1 : std::min(1.0, 2 * FairBinomialCdf(least, flips));
}

/// P(X <= k), X ~ Bin(n, p).
double BinomialCdf(std::int64_t k, std::int64_t n, double p) {
  if (k < 0) return 0;
  if (k >= n) return 1;
  return BetaCdf(static_cast<double>(n - k), static_cast<double>(k + 1), 1 - p);
}

/// What exact McNemar rejects for 0, 1, 2 … flips; the same for every number of pairs, so kept while sizes are tried.
class McNemarRejections {
 public:
  McNemarRejections(const FlipRates& rates, double alpha) : alpha_(alpha) {
    RequireShare(rates.only_first, "only_first");
    RequireShare(rates.only_second, "only_second");
    const double sum = rates.only_first + rates.only_second;
    if (sum > 1 + kRounding) throw InvalidInput("statistics: flips of {} of the pairs, wanted at most 1", sum);
    discordance_ = std::min(sum, 1.0);
    share_ = sum > 0 ? rates.only_first / sum : 0;
  }

  double Power(std::int64_t pairs) {
    if (discordance_ == 0) return 0;
    double power = 0;
    for (std::int64_t flips = 0; flips <= pairs; ++flips) {
      power += BinomialPmf(flips, pairs, discordance_) * Given(flips);
    }
    return power;
  }

 private:
  /// P(it rejects | flips), each flip the first's with probability `share_`.
  double Given(std::int64_t flips) {
    while (static_cast<std::int64_t>(given_.size()) <= flips) {
      const std::int64_t n = static_cast<std::int64_t>(given_.size());
      // The most flips of the rarer kind that are still rejected; it never falls as n grows.
      while (limit_ + 1 <= n / 2 && ExactMcNemarP(limit_ + 1, n) <= alpha_ * (1 + kRounding)) ++limit_;
      given_.push_back(BinomialCdf(limit_, n, share_) + BinomialCdf(limit_, n, 1 - share_));
    }
    return given_[static_cast<std::size_t>(flips)];
  }

  double alpha_, discordance_ = 0, share_ = 0;
  std::int64_t limit_ = -1;
  std::vector<double> given_;  ///< [flips]
};

/// Two-sided Fisher p of every table with these margins, by successes of the first group.
std::vector<long double> FisherPValues(const Margins& margins) {
  const std::vector<long double> pmf = HypergeometricPmf(margins);
  std::vector<long double> p_values;
  for (const long double observed : pmf) {
    long double p = 0;
    for (const long double other : pmf) p += other <= observed * (1 + kClearlyDifferent) ? other : 0;
    p_values.push_back(p);
  }
  return p_values;
}

}  // namespace

double WilsonHalfWidth(double p, std::int64_t n, double confidence) {
  RequireShare(p, "p");
  if (n < 1) throw InvalidInput("statistics: {} trials, wanted at least 1", n);
  const double z = TwoSidedZ(confidence), trials = static_cast<double>(n);
  return z * std::sqrt(p * (1 - p) / trials + z * z / (4 * trials * trials)) / (1 + z * z / trials);
}

std::int64_t TrialsForHalfWidth(double p, double half_width, double confidence) {
  if (!(half_width > 0)) throw InvalidInput("statistics: half_width is {}, wanted above 0", half_width);
  std::int64_t enough = 1;
  while (WilsonHalfWidth(p, enough, confidence) > half_width) {
    if (enough > (std::int64_t{1} << 50))
      throw InvalidInput("statistics: half_width {} needs more trials than can be counted", half_width);
    enough *= 2;
  }
  std::int64_t too_few = enough / 2;  // the width falls with n
  while (enough - too_few > 1) {
    const std::int64_t middle = (enough + too_few) / 2;
    (WilsonHalfWidth(p, middle, confidence) > half_width ? too_few : enough) = middle;
  }
  return enough;
}

SampleSize TrialsPerPolicy(double p1, double p2, const Promise& promise) {
  Check(promise);
  RequireShare(p1, "p1");
  RequireShare(p2, "p2");
  if (p1 == p2) return {.exact = Undefined{"the two rates are equal"}, .n = 0};
  return RoundedUp(PerArm(p1, p2, promise));
}

Number DetectableDifference(double p, std::int64_t n, const Promise& promise) {
  Check(promise);
  RequireShare(p, "p");
  if (n < 1) throw InvalidInput("statistics: {} trials, wanted at least 1", n);
  const double furthest = p >= 0.5 ? 0 : 1, room = std::abs(p - furthest);
  const auto is_enough = [&](double d) {
    return PerArm(p, p + (furthest - p) / room * d, promise) <= static_cast<double>(n);
  };
  if (!is_enough(room)) return Undefined{"too few trials to tell any two rates apart"};
  double no = 0, yes = room;
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = (no + yes) / 2;
    (is_enough(middle) ? yes : no) = middle;
  }
  return yes;
}

double McNemarPower(std::int64_t pairs, const FlipRates& rates, double alpha) {
  RequireInside(alpha, "alpha");
  if (pairs < 0) throw InvalidInput("statistics: {} pairs, wanted at least 0", pairs);
  return McNemarRejections(rates, alpha).Power(pairs);
}

SampleSize PairsForMcNemar(const FlipRates& rates, const Promise& promise, std::int64_t most) {
  Check(promise);
  if (rates.only_first == rates.only_second) return {.exact = Undefined{"both flips are equally frequent"}, .n = 0};
  McNemarRejections rejections(rates, promise.alpha);
  const Undefined too_many{fmt::format("more than {} pairs", most)};
  const auto holds = [&](std::int64_t pairs) { return rejections.Power(pairs) >= promise.power; };
  const auto beyond = [&](std::int64_t pairs) { return std::min(most, pairs + pairs / 4); };
  std::int64_t enough = 2;  // the power is a saw: it may hold here and not a little further on
  while (enough < most && !(holds(enough) && holds(beyond(enough)))) enough = std::min(most, enough * 2);
  if (!holds(beyond(enough))) return {.exact = too_many, .n = 0};
  std::int64_t n = beyond(enough);  // from there down to the last size at which it does not hold
  while (n > 0 && holds(n)) --n;
  return {.exact = static_cast<double>(n + 1), .n = n + 1};
}

Defined<std::int64_t> FurtherWanted(double wanted, const Repeated& have) {
  const double each = have.effective > 0 ? static_cast<double>(have.all) / static_cast<double>(have.effective) : 1;
  const double all = std::ceil(wanted * each);
  if (!(all < 0x1.0p53)) return Undefined{"more than can be counted"};
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(all) - have.all);
}

double FisherPower(std::int64_t n, double p1, double p2, double alpha) {
  RequireInside(alpha, "alpha");
  RequireShare(p1, "p1");
  RequireShare(p2, "p2");
  if (n < 0) throw InvalidInput("statistics: {} trials, wanted at least 0", n);
  double power = 0;
  for (std::int64_t successes = 0; successes <= 2 * n; ++successes) {
    const Margins margins{n, n, successes};
    const std::vector<long double> p_values = FisherPValues(margins);
    for (std::size_t i = 0; i < p_values.size(); ++i) {
      const std::int64_t x1 = LeastOf(margins) + static_cast<std::int64_t>(i);
      if (p_values[i] > alpha * (1 + kRounding)) continue;
      power += BinomialPmf(x1, n, p1) * BinomialPmf(successes - x1, n, p2);
    }
  }
  return power;
}

SampleSize PointsForCorrelation(double r, const Promise& promise) {
  Check(promise);
  if (!(r >= -1 && r <= 1)) throw InvalidInput("statistics: r is {}, wanted -1 <= r <= 1", r);
  if (r == 0) return {.exact = Undefined{"the correlation is 0"}, .n = 0};
  if (std::abs(r) == 1) return {.exact = Undefined{"the correlation is exact"}, .n = 0};
  const double root = (TwoSided(promise) + NormalQuantile(promise.power)) / std::atanh(r);
  return RoundedUp(root * root + 3);
}

SampleSize PairsForNonInferiority(double discordance, double margin, const Promise& promise) {
  Check(promise);
  RequireShare(discordance, "discordance");
  RequireInside(margin, "margin");
  const double z = OneSidedSum(promise), z_alpha = std::max(0.0, NormalQuantile(1 - promise.alpha));
  const double by_flips = z * z * discordance / (margin * margin);
  const double by_none = z_alpha * z_alpha * (1 - margin) / margin;  // then the interval ends at z² / (n + z²)
  return RoundedUp(std::max({1.0, by_flips, by_none}));
}

SampleSize TrialsForNonInferiority(double p, double margin, const Promise& promise) {
  RequireShare(p, "p");
  return PairsForNonInferiority(2 * p * (1 - p), margin, promise);
}

PanelQuality PanelOf(int raters, double accuracy) {
  RequireShare(accuracy, "accuracy");
  if (raters < 1) throw InvalidInput("statistics: {} raters, wanted at least 1", raters);
  PanelQuality quality;
  for (int right = raters / 2 + 1; right <= raters; ++right)
    quality.majority_right += BinomialPmf(right, raters, accuracy);
  quality.split = 1 - std::pow(accuracy, raters) - std::pow(1 - accuracy, raters);
  return quality;
}

int RatersFor(double accuracy, double wanted_right) {
  RequireShare(wanted_right, "wanted_right");
  for (int raters = 1; raters <= 99; raters += 2) {
    if (PanelOf(raters, accuracy).majority_right >= wanted_right) return raters;
  }
  return 0;
}

}  // namespace evac
