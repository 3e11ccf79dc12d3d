#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "reports/policy_comparison.h"

/// What `evac compare` prints (docs/compare.md).
namespace evac {

/// One sequential bet as it stands: of one task, or of all (task empty).
struct BetState {
  std::string task;
  std::int64_t pairs = 0;
  Flips flips;
  double e_value = 1;  ///< now
  double largest = 1;  ///< of all looks, this one included
  int looks = 0;
};

/// One world's comparison, and with --sequential its bets (of what has pairs, all tasks last), else none.
struct ComparedWorld {
  std::string world, judge;
  PolicyComparison comparison;
  std::vector<BetState> bets;
  std::vector<std::string> other_judges = {};  ///< who told an outcome where `judge` told none; else empty
  std::string second_judge = {};               ///< who judged the second policy, if it was not `judge`; else empty
};

/// A sentence, then the table.
std::string ComparisonText(const ComparedWorld& compared);
nlohmann::ordered_json ComparisonJson(const ComparedWorld& compared);
/// One task, or all of them, as ComparisonJson has it in "tasks" and "all_tasks".
nlohmann::ordered_json JsonOf(const ComparisonRow& row);

/// "visual_pick@good is better: 85 % against 55 %, +30 points [10, 48], p = 0.03 (exact McNemar, 20 pairs)."
std::string DecisionOf(const PolicyComparison& comparison);

}  // namespace evac
