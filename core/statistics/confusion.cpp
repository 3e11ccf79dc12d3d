#include "core/statistics/confusion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/statistics/rates.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

Number Ratio(double numerator, double denominator, const char* if_zero) {
  if (denominator == 0) return Undefined{if_zero};
  return numerator / denominator;
}

/// The table as shares, [judge][human], and its margins.
struct Shares {
  explicit Shares(const Confusion& c) {
    const double n = static_cast<double>(c.total());
    both = static_cast<double>(c.both_success) / n;
    judge_only = static_cast<double>(c.only_judge_success) / n;
    human_only = static_cast<double>(c.only_human_success) / n;
    neither = static_cast<double>(c.both_failure) / n;
    judge = static_cast<double>(c.both_success + c.only_judge_success) / n;
    human = static_cast<double>(c.both_success + c.only_human_success) / n;
  }
  double both, judge_only, human_only, neither, judge, human;
};

/// Fleiss, Cohen & Everitt 1969, eq. 13, without the division by n.
double KappaVariance(const Shares& s, double chance, double kappa) {
  const auto squared = [](double x) { return x * x; };
  const double diagonal = s.both * squared(1 - (s.judge + s.human) * (1 - kappa)) +
                          s.neither * squared(1 - (2 - s.judge - s.human) * (1 - kappa));
  const double off_diagonal = squared(1 - kappa) * (s.judge_only * squared(s.human + 1 - s.judge) +
                                                    s.human_only * squared(1 - s.human + s.judge));
  return (diagonal + off_diagonal - squared(kappa - chance * (1 - kappa))) / squared(1 - chance);
}

void AddKappa(const Confusion& confusion, double confidence, ConfusionStatistics& result) {
  const Shares s(confusion);
  const double chance = s.judge * s.human + (1 - s.judge) * (1 - s.human), n = static_cast<double>(result.n);
  result.chance = chance;
  const bool is_constant = confusion.both_success == result.n || confusion.both_failure == result.n;
  result.kappa.value = result.kappa_se = Undefined{"both always gave the same one answer"};
  result.kappa.interval = Undefined{"both always gave the same one answer"};
  if (is_constant) return;
  const double kappa = (*result.accuracy - chance) / (1 - chance);
  result.kappa.value = kappa;
  const double variance = KappaVariance(s, chance, kappa) / n;
  result.kappa_se = Undefined{"the estimated spread is 0"};
  result.kappa.interval = Undefined{"the estimated spread is 0"};
  if (variance * n < 1e-12) return;
  const double se = std::sqrt(variance), z = TwoSidedZ(confidence);
  result.kappa_se = se;
  result.kappa.interval = Interval{std::max(-1.0, kappa - z * se), std::min(1.0, kappa + z * se)};
}

/// By how much an item moves kappa, times n: kappa's derivative at the shares (what FCE's variance is the mean square of).
double Influence(const Shares& s, double chance, bool judge, bool human) {
  const double agreement = s.both + s.neither;
  const double more_agreement = (judge == human ? 1 : 0) - agreement;
  const double more_chance =
      ((judge ? 1 : 0) - s.judge) * (2 * s.human - 1) + ((human ? 1 : 0) - s.human) * (2 * s.judge - 1);
  return (more_agreement * (1 - chance) - (1 - agreement) * more_chance) / ((1 - chance) * (1 - chance));
}

/// Of kappa, from the states' sums of influences; undefined where they cannot show it.
Number StateSe(const ConfusionByState& states, const Confusion& all, double chance) {
  const Shares shares(all);
  double squares = 0, groups = 0;
  for (const auto& [state, c] : states) {
    if (c.total() == 0) continue;
    const auto moved = [&](std::int64_t count, bool judge, bool human) {
      return static_cast<double>(count) * Influence(shares, chance, judge, human);
    };
    const double sum = moved(c.both_success, true, true) + moved(c.only_judge_success, true, false) +
                       moved(c.only_human_success, false, true) + moved(c.both_failure, false, false);
    squares += sum * sum;
    ++groups;
  }
  if (groups < 2) return Undefined{"all items are of one initial state"};
  return std::sqrt(groups / (groups - 1) * squares) / static_cast<double>(all.total());
}

bool HasRepeats(const ConfusionByState& states) {
  return std::ranges::any_of(states, [](const auto& state) { return state.second.total() > 1; });
}

std::int64_t StatesWithItems(const ConfusionByState& states) {
  return std::ranges::count_if(states, [](const auto& state) { return state.second.total() > 0; });
}

/// A share with its interval, or why there is none.
Estimate ShareOf(const Estimate& share, const char* if_none) {
  Estimate result = share;
  if (share.value) return result;
  result.value = Undefined{if_none};
  result.interval = Undefined{if_none};
  return result;
}
Estimate SensitivityOf(const Estimate& share) { return ShareOf(share, "the human saw no success"); }
Estimate SpecificityOf(const Estimate& share) { return ShareOf(share, "the human saw no failure"); }

Estimate ByState(const ConfusionByState& states, double confidence, Count (*of)(const Confusion&)) {
  std::vector<Count> counts;
  for (const auto& [state, confusion] : states) counts.push_back(of(confusion));
  return ClusteredWilsonInterval(counts, confidence);
}
Count Sensed(const Confusion& c) { return {c.both_success, c.both_success + c.only_human_success}; }
Count Specified(const Confusion& c) { return {c.both_failure, c.both_failure + c.only_judge_success}; }

void RequireCounts(const Confusion& c) {
  if (std::min({c.both_success, c.only_judge_success, c.only_human_success, c.both_failure}) < 0)
    throw InvalidInput("statistics: a confusion table with a negative count");
}

void RequireShare(double share, const char* name) {
  if (!(share >= 0 && share <= 1)) throw InvalidInput("statistics: {} is {}, wanted 0 <= {} <= 1", name, share, name);
}

}  // namespace

void Confusion::Add(bool judge, bool human) {
  ++(judge ? (human ? both_success : only_judge_success) : (human ? only_human_success : both_failure));
}

Confusion& Confusion::operator+=(const Confusion& other) {
  both_success += other.both_success;
  only_judge_success += other.only_judge_success;
  only_human_success += other.only_human_success;
  both_failure += other.both_failure;
  return *this;
}

Confusion SumOf(const ConfusionByState& states) {
  Confusion sum;
  for (const auto& [state, confusion] : states) sum += confusion;
  return sum;
}

ConfusionStatistics StatisticsByState(const ConfusionByState& states, double confidence) {
  for (const auto& [state, confusion] : states) RequireCounts(confusion);
  const Confusion all = SumOf(states);
  ConfusionStatistics result = StatisticsOf(all, confidence);
  result.sensitivity = SensitivityOf(ByState(states, confidence, Sensed));
  result.specificity = SpecificityOf(ByState(states, confidence, Specified));
  if (!result.kappa.interval || !HasRepeats(states)) return result;
  result.kappa.method = "linearised by initial state";
  const Number by_state = StateSe(states, all, *result.chance);
  if (!by_state) {
    result.kappa_se = Undefined{by_state.reason()};
    result.kappa.interval = Undefined{by_state.reason()};
    return result;
  }
  const double kappa = *result.kappa.value, se = std::max(*by_state, *result.kappa_se),
               t = TwoSidedT(confidence, static_cast<double>(StatesWithItems(states) - 1));
  result.kappa_se = se;
  result.kappa.interval = Interval{std::max(-1.0, kappa - t * se), std::min(1.0, kappa + t * se)};
  return result;
}

ConfusionStatistics StatisticsOf(const Confusion& confusion, double confidence) {
  const auto [tp, fp, fn, tn] = confusion;
  RequireCounts(confusion);
  TwoSidedZ(confidence);  // complains
  ConfusionStatistics result;
  result.n = confusion.total();
  result.kappa.method = "Fleiss-Cohen-Everitt";
  result.kappa.confidence = confidence;
  result.kappa.n = result.n;
  result.kappa.value = Undefined{"no items"};
  result.kappa.interval = Undefined{"no items"};
  const Count sensed = Sensed(confusion), specified = Specified(confusion);
  result.sensitivity = SensitivityOf(WilsonInterval(sensed.successes, sensed.trials, confidence));
  result.specificity = SpecificityOf(WilsonInterval(specified.successes, specified.trials, confidence));
  if (result.n == 0) return result;

  const double n = static_cast<double>(result.n), dtp = static_cast<double>(tp), dfp = static_cast<double>(fp),
               dfn = static_cast<double>(fn), dtn = static_cast<double>(tn);
  const double accuracy = (dtp + dtn) / n;
  result.accuracy = accuracy;
  result.pabak = 2 * accuracy - 1;
  AddKappa(confusion, confidence, result);
  const double q = (2 * dtp + dfp + dfn) / (2 * n), by_chance = 2 * q * (1 - q);
  result.gwet_ac1 = (accuracy - by_chance) / (1 - by_chance);  // by_chance is at most 1/2
  result.matthews =
      Ratio(dtp * dtn - dfp * dfn, std::sqrt((dtp + dfp) * (dtp + dfn)) * std::sqrt((dtn + dfp) * (dtn + dfn)),
            "one of the two always gave the same answer");
  result.balanced_accuracy = Undefined{"the human always gave the same answer"};
  if (result.sensitivity.value && result.specificity.value)
    result.balanced_accuracy = (*result.sensitivity.value + *result.specificity.value) / 2;
  result.precision = Ratio(dtp, dtp + dfp, "the judge saw no success");
  result.f1 = Ratio(2 * dtp, 2 * dtp + dfp + dfn, "nobody saw a success");
  result.bias = (dfp - dfn) / n;
  return result;
}

CorrectedRate RoganGladen(const JudgedRate& judged, const JudgeQuality& quality) {
  RequireShare(judged.rate, "rate");
  RequireShare(quality.sensitivity, "sensitivity");
  RequireShare(quality.specificity, "specificity");
  CorrectedRate result;
  const double youden = quality.sensitivity + quality.specificity - 1;
  if (std::abs(youden) < 1e-12) {
    result.raw = result.rate = result.se = Undefined{"the judge is no better than chance"};
    return result;
  }
  const double raw = (judged.rate + quality.specificity - 1) / youden;
  result.raw = raw;
  result.rate = std::clamp(raw, 0.0, 1.0);
  result.se = Undefined{"no items behind the rate, the sensitivity or the specificity"};
  if (judged.n <= 0 || quality.positives <= 0 || quality.negatives <= 0) return result;
  const auto variance = [](double p, std::int64_t n) { return p * (1 - p) / static_cast<double>(n); };
  result.se = std::sqrt(variance(judged.rate, judged.n) + raw * raw * variance(quality.sensitivity, quality.positives) +
                        (1 - raw) * (1 - raw) * variance(quality.specificity, quality.negatives)) /
              std::abs(youden);
  return result;
}

}  // namespace evac
