#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/statistics/rate_difference.h"
#include "core/store.h"
#include "reports/gate_baseline.h"
#include "reports/gate_decision.h"
#include "reports/gate_rules.h"

/// Which episodes one rule of a gate is about: chosen, checked and paired, before anything is tested.
namespace evac {

/// The candidate as it is, and the pinned baseline.
struct GateData {
  const PinnedResult& candidate;
  const PinnedResult* baseline = nullptr;  ///< null: none was given
  std::vector<PlannedEpisodes> missing = {};  ///< of the candidate: MissingOf its plan
};

/// One policy in one world, a cell per task.
struct GateSide {
  std::string policy;  ///< empty: all of them, where the rule is about no policy
  std::vector<const PinnedCell*> cells;
  std::int64_t episodes = 0, errors = 0;

  /// @param cell  outlives this.
  void Add(const PinnedCell& cell);
};

struct GateSides {
  std::string world;
  GateSide candidate, baseline;  ///< baseline empty where the rule does not compare
};

/// Whether a part of the suite's plan is of the rule's task and policy (empty: of any) in such a world.
bool IsOfRule(const PlannedEpisodes& part, const GateRule& rule, const std::string& world);

/// Where episodes of the rule are missing, the candidate may have a part of the baseline's initial states, or no cell.
/// @throws InvalidInput naming the rule: a policy, world or task that is not there or is not named where there are
/// several; no baseline; another task page than the baseline's, or another scene, stop rule, picture size, chunk size
/// or latency, as far as both sides know theirs (PinnedResult); for pairs another list of initial states or another
/// world profile (of a sequential rule the states may be a part); without pairs more than one task on
/// either side, or not the same.
GateSides SidesOf(const GateRule& rule, const GateData& data);

/// Of a rule that compares, before there is a candidate: what SidesOf would refuse of the baseline whatever that is.
/// @param judge  the rules', which may stand for the baseline's full name
/// @throws InvalidInput naming the rule: another judge; a task, world or policy that the baseline has not, or no policy
/// of several; no episode of these; more than one task where none is paired.
void DemandSideOf(const GateRule& rule, const std::string& judge, const PinnedResult& baseline);

/// The states that count on both sides. "First" is the candidate: flips.only_first are for the better.
struct GatePairs {
  std::vector<PairedOutcomes> by_state;    ///< by (task, initial state)
  PairedOutcomes all;                      ///< of them together
  PairedOutcomes effective;                ///< where states repeat (several seeds), what the pairs tell as much as
  PairedOutcomes one_each;                 ///< one pair of each state: the first seed that counts in the baseline, so
                                           ///< that a growing run adds pairs and exchanges none
  std::vector<Count> candidate, baseline;  ///< by (task, initial state)
  std::vector<CounterExample> counter_examples;  ///< at most kMostCounterExamples, in order
};
inline constexpr std::size_t kMostCounterExamples = 200;
GatePairs PairUp(const GateSides& sides, const GateData& data);

/// Successes and trials by (task, initial state) of what counts.
std::vector<Count> CountsOf(const GateSide& side);

}  // namespace evac
