#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/store.h"
#include "core/store_calls.h"
#include "core/types.h"
#include "reports/comparison.h"
#include "reports/letters.h"
#include "reports/outcome.h"

/// One run, counted: everything the page and the JSON say, before it is said. Read this file first.
namespace evac {

/// What the store holds of a run, read once. Everything after `ReadRun` is a pure function of it.
struct RunData {
  RunInfo run;
  std::vector<Task> tasks;
  std::vector<WorldInfo> worlds;
  std::vector<PolicyInfo> policies;
  std::vector<Episode> episodes;                                   ///< in pair-key order, then world
  std::map<std::string, std::map<std::string, Verdict>> verdicts;  ///< the current one per (episode id, judge)
  std::map<std::string, Counters> counters;                        ///< per policy
  std::vector<RealTrial> real_trials = {};                         ///< imported ones, in the order they were added
  std::vector<GateRecord> gates;                                   ///< what gates decided, oldest first
  std::vector<CallTotals> judge_calls = {};                        ///< to model servers, by judge
  std::vector<PlannedEpisodes> plan = {};                          ///< empty: an earlier evac began the run
  std::map<std::string, std::string> page_hashes = {};             ///< Store::PageHashes
};
RunData ReadRun(const Store& store);

struct SummaryOptions {
  std::string judge = "oracle";     ///< whose verdicts are counted
  double confidence = 0.95;         ///< of every interval, two-sided
  int bootstrap_replicates = 2000;  ///< B of the paired state bootstrap
  std::uint64_t bootstrap_seed = 0;
};

/// One (task, policy, world): its success rate, and apart from it what cannot count.
struct RateCell {
  std::string task, policy, world;               ///< policy with its checkpoint: "visual_pick@good"
  std::array<std::int64_t, kOutcomes> counts{};  ///< episodes by Outcome
  std::int64_t states = 0;                       ///< initial states with a success or a failure
  std::string letters = {};  ///< reports/letters.h; empty before they were given, or without another policy
  Estimate rate;  ///< successes / (successes + failures); Wilson, clustered by initial state where states repeat
  std::int64_t Of(Outcome outcome) const { return counts[static_cast<std::size_t>(outcome)]; }
  std::int64_t Apart() const;  ///< episodes that are in no rate
};

struct RunSummary {
  RunData data;
  SummaryOptions options;
  std::vector<std::string> judges;      ///< that gave any verdict
  std::vector<JudgedEpisode> episodes;  ///< in the order of data.episodes
  std::vector<std::string> policies;    ///< "name@checkpoint", in the order declared
  std::vector<RateCell> rates;          ///< by task, policy, world, in the orders declared; only those with episodes
  std::string reference;                ///< the real world's name; empty if there is none
  std::vector<WorldComparison> comparisons;  ///< each other world with the reference
  std::vector<PolicyContest> contests = {};  ///< reports/letters.h: what letters rest on; empty before they were given
  std::int64_t Count(Outcome outcome) const;
};

/// @throws InvalidInput unless 0 < confidence < 1 and bootstrap_replicates > 0.
RunSummary Summarise(RunData data, const SummaryOptions& options);

/// "vlm:x,vlm:x:small": whom to count so that clips which the last judge was shown small are judged, too; empty where none
/// of those that are not judged was.
std::string CountedWithSmall(const RunSummary& summary);

/// The same episodes as another judge counts them: `rates` as they would be with `options.judge` = `judge`.
struct JudgeRates {
  std::string judge;
  std::vector<RateCell> rates;
};
/// Of every other judge that gave a verdict; not of single raters, whose votes are counted as judge `human`.
std::vector<JudgeRates> RatesOfOtherJudges(const RunSummary& summary);

}  // namespace evac
