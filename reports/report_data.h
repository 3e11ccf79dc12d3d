#pragma once

#include <string>
#include <vector>

#include "reports/checkpoints.h"
#include "reports/gate_decision.h"
#include "reports/judge_agreement.h"
#include "reports/letters.h"
#include "reports/policy_comparison.h"
#include "reports/stages.h"
#include "reports/summary.h"
#include "reports/trust_worlds.h"

/// Everything a report says, counted once: what `RunSummary` holds, and what follows from it.
namespace evac {

struct ReportOptions {
  std::string baseline = {};  ///< the policy others are held against, "visual_pick@good"; empty: the first declared
  TrustOptions trust = {};    ///< its confidence and bootstrap follow the summary's
};

/// One policy against the baseline.
struct Candidate {
  PolicyComparison comparison;                          ///< first: the candidate; second: the baseline
  Number p_holm = Undefined{"no episodes to compare"};  ///< of all tasks together, over all candidates
  std::vector<Number> task_p_holm = {};                 ///< [comparison.tasks] over all candidates and their tasks
  Defined<std::int64_t> more = Undefined{"no episodes to compare"};  ///< of all tasks, as MoreToDecide says it at this
                                                                     ///< candidate's share of alpha
};

struct ReportData {
  RunSummary summary;
  std::string baseline;               ///< empty where the run has fewer than two policies
  std::string world;                  ///< where candidates are compared: the real one, else the first
  std::vector<Candidate> candidates;  ///< in the order declared
  LetterTests letters;                ///< what the letters of `summary.rates` rest on
  std::vector<JudgeRates> by_judge;   ///< the rates as each other judge counts them
  std::vector<TrustReport> trust;     ///< one per world beside the real one of which something can be said
  std::vector<UnsaidWorld> unsaid;    ///< the others: nobody judged them, or there is nothing to hold them against
  std::string no_trust;               ///< why `trust` is empty, else empty
  std::vector<ShownGate> gates;       ///< the last decision of each gate that was held against this run
  StageReport stages;
  JudgeReport judges;
  std::vector<CheckpointCurve> checkpoints;
};

/// @throws InvalidInput if the baseline is no policy of the run, naming those there are.
ReportData ReportDataOf(RunSummary summary, const ReportOptions& options = {});

}  // namespace evac
