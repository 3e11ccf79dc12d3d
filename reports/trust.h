#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/confusion.h"
#include "core/statistics/estimate.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/ppi.h"
#include "reports/correlation.h"
#include "reports/summary.h"

/// How far a world model may be trusted for each task, from trials in both worlds on the same initial states, and what
/// the real success rate is, from few real and many imagined trials (docs/statistics.md). Output: trust_output.h.
namespace evac {

/// One outcome of one policy in one initial state.
struct TrialOutcome {
  std::string task, policy, state;  ///< policy with its checkpoint
  std::uint64_t seed = 0;           ///< or the number of the real trial
  bool success = false;
};

struct TrustInput {
  std::vector<TrialOutcome> real, model;
  /// Real trials that evac ran carry the model's seeds: only equal ones are a pair. Imported ones are paired with the
  /// model's episodes of the same state in order.
  bool seeds_agree = true;
};

struct TrustOptions {
  double confidence = 0.95;
  double margin = 0.1;  ///< how far the model's rate may be from the real one, in (0, 1)
  BootstrapOptions bootstrap = {};
};

enum class Trust { kYes, kNo, kUnknown };
/// "yes", "no", "unknown".
const char* Name(Trust trust);

/// Below this many policies a correlation over them says nothing.
inline constexpr std::size_t kMinTrustPolicies = 4;
/// Where more than these would be needed, the bias lies beside the margin by chance of what was seen: no advice.
inline constexpr std::int64_t kMostPairsAskedFor = 10000;

/// One policy on one task.
struct PredictedRate {
  std::string policy;
  BothWorlds pairs;
  Count further;                ///< imagined outcomes on states without a real trial
  std::int64_t real_alone = 0;  ///< real trials without an imagined partner
  Estimate real;                ///< from all real trials, clustered by state
  Estimate model;               ///< from all imagined trials, clustered by state
  Estimate predicted;           ///< real rate from both: MOVER on the effective pairs, the interval of record
  Estimate betting;             ///< the same by betting on one pair of each state, the first
  PpiEstimate tuned;            ///< the same by PPI++: an estimate; its intervals are over initial states
};

struct TaskTrust {
  std::string task;
  std::int64_t states = 0;                ///< initial states with a pair
  std::int64_t effective_pairs = 0;       ///< that the bias rests on: repeats and shared states considered
  std::int64_t tested_pairs = 0;          ///< the same of the test, to which pairs that agree are nothing
  BothWorlds pairs;                       ///< over all policies
  Estimate real, model;                   ///< rates over the pairs, clustered by state
  Estimate bias;                          ///< model - real over the pairs, Tango
  McNemar test;                           ///< of "no bias", on the effective pairs
  ConfusionStatistics agreement;          ///< the model as judge of what the robot would do: kappa
  Estimate same;                          ///< share of pairs with one outcome, clustered by state
  Estimate correlation;                   ///< Pearson over policies, undefined below kMinTrustPolicies
  std::int64_t undefined_replicates = 0;  ///< of its bootstrap, dropped
  Trust trust = Trust::kUnknown;
  Defined<std::int64_t> more = Undefined{"decided"};  ///< further pairs that would decide, if the bias is that seen
  std::vector<PredictedRate> policies;
};

/// Yes: the bias's interval lies within ± margin. No: it lies outside. Else unknown.
/// @throws InvalidInput if an option is out of range, or there is no real or no imagined outcome.
std::vector<TaskTrust> TrustOf(const TrustInput& input, const TrustOptions& options = {});

/// What a run holds: its imported real trials, else the episodes of its real world; and the other world's episodes.
/// @throws InvalidInput if there are neither, or no world of that name.
TrustInput TrustInputOf(const RunSummary& summary, const std::vector<RealTrial>& imported, const std::string& world);

}  // namespace evac
