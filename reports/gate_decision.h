#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/store.h"

/// What `evac gate` decided, as it is kept in the store, and shown by the report, junit.xml and summary.md.
namespace evac {

/// Exit codes 0, 1 and 3 of `evac gate`.
enum class GateOutcome { kPass, kFail, kInconclusive };
/// "pass", "fail", "inconclusive".
const char* Name(GateOutcome outcome);

/// An initial state in which the baseline succeeded and the candidate did not.
struct CounterExample {
  std::string task, initial_state;
  std::uint64_t seed = 0;
  std::string candidate_video, baseline_video;  ///< with their runs' folders in front; empty: there is none
};

/// What one rule came to. What a rule does not use stays empty or undefined.
struct RuleDecision {
  std::string name, test, metric;
  std::string task;  ///< empty: all tasks together
  std::string world, policy, baseline_policy;
  GateOutcome outcome = GateOutcome::kInconclusive;
  std::string statement;  ///< the outcome with its numbers, one sentence or two
  std::string more;       ///< "about 84 more pairs would decide"; empty where it is decided
  Estimate value;         ///< of the metric: the candidate's rate, the correlation, kappa, the share of errors
  Estimate baseline;      ///< the baseline's rate
  Estimate difference;    ///< candidate - baseline; its low end is what the margin is held against
  Number p = Undefined{"the rule has no test of failure"};           ///< of "it is not worse": small means fail
  Number p_adjusted = Undefined{"the rule has no test of failure"};  ///< after the correction over the rules
  std::int64_t states = 0;        ///< initial states that count (with seeds, but of a bet and of kappa each once);
                                  ///< where the rule compares, in both
  std::int64_t flips_worse = 0;   ///< baseline succeeded, candidate did not
  std::int64_t flips_better = 0;  ///< the other way round
  std::vector<CounterExample> counter_examples;
};

struct GateDecision {
  std::string name;           ///< of the rules
  std::string judge;          ///< whose verdicts were counted, in full; empty in a decision that was kept without
  std::string rules_hash;     ///< SHA-256 of the rules' meaning
  std::string baseline_hash;  ///< the pinned result's own; empty without a baseline
  std::string data_hash;      ///< SHA-256 of everything that was counted of the run
  GateOutcome outcome = GateOutcome::kInconclusive;
  std::vector<std::string> sizes;  ///< how many episodes the rules need: what is printed first
  std::vector<RuleDecision> rules;

  /// What the decision follows from: the same key, the same decision.
  std::string Key() const;
};

/// A decision as a report shows it.
struct ShownGate {
  GateDecision decision;
  bool is_current = false;  ///< false: the run has changed since, and the decision speaks of older data
};
/// The graver, the sooner a reader must hear of it: fail, inconclusive, pass of older data, pass; of fails those of older
/// data come second.
int GravityOf(const ShownGate& gate);

/// The last decision of each gate, in the order of their names. @param data_hash  of the run as it is.
std::vector<ShownGate> LastGates(const std::vector<GateRecord>& records, const std::string& data_hash);

/// docs/formats/gate_json.md names the keys.
nlohmann::ordered_json JsonOf(const GateDecision& decision);
/// @throws InternalError if `document` is not what JsonOf writes: it comes from a store that only evac writes.
GateDecision GateDecisionFromJson(const std::string& document);

}  // namespace evac
