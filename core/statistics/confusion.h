#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "core/statistics/estimate.h"

/// One judge against the truth (a human's verdicts): docs/statistics.md.
namespace evac {

/// How often the judge and the human said what. "Positive" is success.
struct Confusion {
  std::int64_t both_success = 0;        ///< true positives
  std::int64_t only_judge_success = 0;  ///< false positives
  std::int64_t only_human_success = 0;  ///< false negatives
  std::int64_t both_failure = 0;        ///< true negatives
  std::int64_t total() const { return both_success + only_judge_success + only_human_success + both_failure; }
  void Add(bool judge, bool human);  ///< one item: what each said of it
  Confusion& operator+=(const Confusion& other);
};

/// Task and initial state: clips of one state, by several policies or seeds, tell less than as many others.
using StateKey = std::pair<std::string, std::string>;
using ConfusionByState = std::map<StateKey, Confusion>;
Confusion SumOf(const ConfusionByState& states);

/// Each undefined where its denominator is 0.
struct ConfusionStatistics {
  Number accuracy = Undefined{"no items"};
  Number chance = Undefined{"no items"};  ///< agreement by chance, p_e
  Estimate kappa;  ///< Cohen's; interval from the SE of Fleiss, Cohen & Everitt 1969, cut to -1 … 1
  Number kappa_se =
      Undefined{"no items"};             ///< undefined where it comes out as 0: kappa has no spread to estimate there
  Number pabak = Undefined{"no items"};  ///< prevalence- and bias-adjusted: 2 accuracy - 1
  Number gwet_ac1 = Undefined{"no items"};  ///< chance 2 q (1 - q), q the mean share of successes
  Number matthews = Undefined{"no items"};  ///< Matthews' correlation
  Estimate sensitivity, specificity;         ///< shares of the human's successes and failures, Wilson's interval
  Number balanced_accuracy = Undefined{"no items"};  ///< mean of the two
  Number precision = Undefined{"no items"}, f1 = Undefined{"no items"};
  Number bias = Undefined{"no items"};  ///< judge's success rate - human's: above 0 where the judge is too kind
  std::int64_t n = 0;
};
/// @throws InvalidInput if a count is negative or unless 0 < confidence < 1.
ConfusionStatistics StatisticsOf(const Confusion& confusion, double confidence = 0.95);
/// The same of the sum, but for intervals, which hold over other initial states of the kind. Sensitivity and specificity
/// count by their design effect (ClusteredWilsonInterval). Of kappa the errors of the linearised kappa are summed within
/// each of the G states that have items before they are squared (G / (G - 1) times), never below that of independent
/// items, and the interval takes Student's t of G - 1 degrees. Undefined for one state of several items; with one item a
/// state, as above.
ConfusionStatistics StatisticsByState(const ConfusionByState& states, double confidence = 0.95);

/// What a judge with known errors saw, corrected (Rogan & Gladen 1978).
struct JudgedRate {
  double rate = 0;  ///< share that the judge called success
  std::int64_t n = 0;
};
struct JudgeQuality {
  double sensitivity = 1, specificity = 1;
  std::int64_t positives = 0, negatives = 0;  ///< how many human verdicts the two rest on
};
struct CorrectedRate {
  Number raw = Undefined{"not computed"};   ///< (rate + specificity - 1) / (sensitivity + specificity - 1)
  Number rate = Undefined{"not computed"};  ///< the same, within [0, 1]
  Number se = Undefined{"not computed"};    ///< delta method, of the unclipped rate
};
/// Undefined for a judge no better than chance. @throws InvalidInput for shares outside [0, 1].
CorrectedRate RoganGladen(const JudgedRate& judged, const JudgeQuality& quality);

}  // namespace evac
