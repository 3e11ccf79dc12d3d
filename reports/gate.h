#pragma once

#include <string>
#include <vector>

#include "core/store.h"
#include "reports/gate_baseline.h"
#include "reports/gate_decision.h"
#include "reports/gate_rules.h"
#include "reports/summary.h"

/// Is the candidate good enough? Rules (gate_rules.h) held against a run and a pinned baseline (gate_baseline.h),
/// decided with three outcomes (gate_decision.h). Read this file first, then docs/gate.md.
///
/// A gate fails if any rule fails: the failing p-values are corrected over the rules (Holm), so that the risk of a
/// false alarm is alpha for the whole file. It passes only if every rule passes: each may be tested at its own alpha
/// without a correction (intersection-union). Else it is inconclusive.
namespace evac {

/// The candidate's run, counted by the rules' judge, and what is known of it beside.
struct GateCandidate {
  const RunSummary& run;
  std::string folder;                 ///< as the user named it, for the paths of clips
  std::vector<SequentialLook> looks;  ///< at this run, oldest first
};

/// A decision, and what has to be kept with it.
struct GateResult {
  GateDecision decision;
  std::vector<SequentialLook> looks;  ///< taken by this decision
};

/// @param baseline  null where none was given: only rules that need none may be asked for.
/// @throws InvalidInput for a rule that cannot be held against these data (gate_sides.h).
GateResult Decide(const GateRules& rules, const GateCandidate& candidate, const PinnedResult* baseline);

/// What is known before the candidate's run of whether its rules can be held against this baseline.
/// @throws InvalidInput naming the rule, for what Decide would refuse whatever the candidate is (gate_sides.h).
void DemandBaseline(const GateRules& rules, const PinnedResult& baseline);

/// How many episodes each rule that compares needs, a sentence each: what is known before the run.
/// @param baseline  null: rates of 70 % are assumed.
std::vector<std::string> SizesOf(const GateRules& rules, const PinnedResult* baseline);

}  // namespace evac
