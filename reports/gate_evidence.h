#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/store.h"
#include "reports/gate_decision.h"
#include "reports/gate_sides.h"
#include "reports/summary.h"

/// What the data say of one rule, before the correction over the rules. Used by gate.cpp.
namespace evac {

/// Everything a gate is decided from.
struct GateInput {
  const RunSummary& run;  ///< the candidate's
  GateData data;
  std::string gate;                   ///< the gate's name
  std::vector<SequentialLook> looks;  ///< at this run, oldest first
};

struct Evidence {
  RuleDecision decision;               ///< all but outcome, p_adjusted, more and the end of the statement
  bool shows_good = false;             ///< the rule may pass: shown to be good enough, at its alpha
  std::string blocked;  ///< why it cannot be decided (missing episodes, too few states, too many errors); else empty
  /// (task, initial state) that count, each once whatever the seeds and policies: what `min_states` asks for. Those of a
  /// rule that compares are in both, or of the candidate where it compares no pairs; those of error_share are all that
  /// were tried.
  std::int64_t initial_states = 0;
  std::optional<GateOutcome> counted;  ///< of a rule that counts instead of testing
  std::string good, bad;               ///< how the two outcomes are called: "not worse by 10 points", "worse"
  std::string more;                    ///< how many more episodes would decide, if it is not decided
  std::optional<SequentialLook> look;  ///< a new look that was taken
};

/// @throws InvalidInput as SidesOf, where a judge or a world is missing, and where a judge were held against itself.
Evidence Examine(const GateRule& rule, const GateInput& input);

}  // namespace evac
