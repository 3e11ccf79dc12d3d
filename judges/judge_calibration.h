#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/rates.h"
#include "core/store.h"

namespace evac {

/// One episode as a judge and the truth (the oracle, or adjudicated humans) saw it.
struct JudgedItem {
  std::string task, policy, world;  ///< policy with its checkpoint: "visual_pick@good"
  bool is_real = false;             ///< of a real world's clip; else of a simulated or imagined one
  Label judge = Label::kCannotTell, truth = Label::kCannotTell;
  std::optional<double> probability{};  ///< of success, as the judge gave it
  std::string initial_state{};          ///< intervals hold over others
};

/// Every episode that has a current verdict of both.
std::vector<JudgedItem> JudgedItems(const Store& store, const std::string& judge, const std::string& truth);

/// A judge against the truth on some items. Only those where both said success or failure are in the statistics.
struct JudgeQualityRow {
  std::string group;  ///< "all", "task take_bottle", "world real", "policy visual_pick@good"
  Confusion confusion{};
  ConfusionStatistics statistics{};
  Calibration calibration{};                 ///< of its probabilities, where it gave them
  std::int64_t cannot_tell = 0, errors = 0;  ///< by the judge, of items that the truth knows
};
JudgeQualityRow QualityOn(const std::vector<JudgedItem>& items, const std::string& group,
                          const std::function<bool(const JudgedItem&)>& is_in);

/// What docs/vlm_judge.md asks of a judge whose verdicts a gate may count.
struct JudgeAcceptance {
  std::int64_t min_items_per_task = 60, min_per_class = 15;
  double min_kappa = 0.6, min_kappa_low = 0.4;
  /// Of a judge that was never wrong, whose kappa has no interval: were it wrong in 30 % of the states, kappa .4 where
  /// both outcomes are as many, so many would show none of it with a chance of 2 % (.7^11).
  std::int64_t min_unerring_states = 11;
  double max_bias = 0.05;               ///< share, either way, in real and in other worlds
  double max_domain_difference = 0.10;  ///< of sensitivity and of specificity between the two
  double max_errors = 0.02;             ///< share
};

/// How often a probe of the judge said the same as it.
struct ProbeAgreement {
  Count same;
  Estimate share{};  ///< its interval holds over other initial states
};

struct JudgeCalibrationReport {
  std::string judge, truth;
  std::vector<JudgeQualityRow> rows{};  ///< all, per task, per world, per policy
  std::vector<std::string> refusals{};  ///< why a gate may not count it
  /// Why nothing can be said yet: too few items of a task where it told successes or failures, or none of such a world.
  std::vector<std::string> missing{};
  std::map<std::string, ProbeAgreement> probes{};  ///< of its probes ("flip", "retest"); none where they never ran
};
JudgeCalibrationReport CalibrateJudge(const Store& store, const std::string& judge, const std::string& truth,
                                      const JudgeAcceptance& wanted = {});

/// A table for people.
std::string Text(const JudgeCalibrationReport& report);

}  // namespace evac
