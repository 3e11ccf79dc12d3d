#include "core/statistics/stratified.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

void Check(const Weighted& side) {
  if (side.successes >= 0 && side.successes <= side.trials && std::isfinite(side.trials)) return;
  throw InvalidInput("statistics: {:g} successes of {:g} trials, wanted 0 <= successes <= trials", side.successes,
                     side.trials);
}

/// The sums over strata that all Mantel-Haenszel statistics are made of.
struct Sums {
  double excess = 0, variance = 0;        ///< of the first group's successes over their expectation
  double concordant = 0, discordant = 0;  ///< sum x1 (n2 - x2) / N, sum x2 (n1 - x1) / N
  double difference = 0, weight = 0;      ///< sum (x1 n2 - x2 n1) / N, sum n1 n2 / N
  double sato_p = 0, sato_q = 0;          ///< of Sato's variance
  double trials = 0;
};

Sums SumsOf(std::span<const Stratum> strata) {
  Sums sums;
  for (const Stratum& stratum : strata) {
    Check(stratum.first);
    Check(stratum.second);
    const auto [x1, n1] = stratum.first;
    const auto [x2, n2] = stratum.second;
    if (n1 == 0 || n2 == 0) continue;
    const double n = n1 + n2, s = x1 + x2;
    sums.excess += x1 - n1 * s / n;
    if (n > 1) sums.variance += n1 * n2 * s * (n - s) / (n * n * (n - 1));
    sums.concordant += x1 * (n2 - x2) / n;
    sums.discordant += x2 * (n1 - x1) / n;
    sums.difference += (x1 * n2 - x2 * n1) / n;
    sums.weight += n1 * n2 / n;
    sums.sato_p += (n1 * n1 * x2 - n2 * n2 * x1 + n1 * n2 * (n2 - n1) / 2) / (n * n);
    sums.sato_q += (x1 * (n2 - x2) + x2 * (n1 - x1)) / (2 * n);
    sums.trials += n;
  }
  return sums;
}

/// Mantel-Haenszel's difference and its standard error.
void AddDifference(const Sums& sums, double confidence, StratifiedTest& test) {
  const double z = TwoSidedZ(confidence);
  Estimate& difference = test.risk_difference;
  difference.method = "Mantel-Haenszel, Sato";
  difference.confidence = confidence;
  difference.n = std::llround(sums.trials);
  difference.value = Undefined{"no trials"};
  difference.interval = Interval{-1, 1};
  if (sums.weight == 0) return;
  const double value = sums.difference / sums.weight;
  const double variance = (value * sums.sato_p + sums.sato_q) / (sums.weight * sums.weight);
  difference.value = value;
  const Undefined none{"no outcome varies within a stratum"};
  difference.interval = none;
  test.difference_se = none;
  if (variance <= 0) return;
  const double se = std::sqrt(variance);
  difference.interval = Interval{std::max(-1.0, value - z * se), std::min(1.0, value + z * se)};
  test.difference_se = se;
}

}  // namespace

StratifiedTest MantelHaenszel(std::span<const Stratum> strata, double confidence) {
  const Sums sums = SumsOf(strata);
  StratifiedTest test;
  AddDifference(sums, confidence, test);
  if (sums.variance > 0) {
    const double chi2 = sums.excess * sums.excess / sums.variance;
    test.chi2 = chi2;
    test.p = ChiSquareTail(chi2, 1);
  }
  if (sums.discordant > 0) test.odds_ratio = sums.concordant / sums.discordant;
  return test;
}

CochranQ CochranQTest(const std::vector<std::vector<bool>>& outcomes) {
  CochranQ test;
  if (outcomes.empty()) return test;
  const std::size_t policies = outcomes.front().size();
  std::vector<double> by_policy(policies, 0);
  double total = 0, row_squares = 0;
  for (const std::vector<bool>& row : outcomes) {
    if (row.size() != policies) {
      throw InvalidInput("statistics: states with {} and {} policies, wanted the same number", policies, row.size());
    }
    const double successes = static_cast<double>(std::ranges::count(row, true));
    for (std::size_t policy = 0; policy < policies; ++policy) by_policy[policy] += row[policy] ? 1 : 0;
    total += successes;
    row_squares += successes * successes;
  }
  const double k = static_cast<double>(policies);
  test.degrees = std::max<std::int64_t>(0, static_cast<std::int64_t>(policies) - 1);
  double column_squares = 0;
  for (const double successes : by_policy) column_squares += successes * successes;
  const double denominator = k * total - row_squares;  // 0 exactly when every state has one outcome for all
  if (denominator == 0) return test;
  const double q = (k - 1) * (k * column_squares - total * total) / denominator;
  test.q = q;
  test.p = ChiSquareTail(q, k - 1);
  return test;
}

}  // namespace evac
