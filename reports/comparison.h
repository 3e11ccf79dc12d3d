#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/bootstrap.h"
#include "core/statistics/estimate.h"
#include "core/statistics/mcnemar.h"
#include "reports/correlation.h"
#include "reports/outcome.h"

/// One world against the real one, from episodes that share their pair key: initial state, seed, policy, task.
namespace evac {

/// Two episodes with one pair key, as indices into RunSummary::episodes.
struct EpisodePair {
  std::size_t real = 0, other = 0;
};

/// The paired outcomes of one (task, policy).
struct PairTable {
  std::string task, policy;
  std::vector<EpisodePair> pairs;  ///< both worlds have the episode; in order of state and seed
  std::int64_t both_succeed = 0, real_only = 0, other_only = 0, both_fail = 0;  ///< of the pairs where both count
  std::int64_t uncounted = 0;  ///< pairs where one of the two is an error, or has no verdict of success or failure
  std::int64_t unpaired = 0;   ///< episodes of either world without their partner
  std::int64_t effective_pairs = 0;  ///< what the counted pairs tell as much as: repeats of a state are not new
  McNemar test;                      ///< of "the two worlds succeed equally often", on the effective pairs
  Estimate agreement;                ///< (both succeed + both fail) / counted pairs
  std::int64_t Counted() const { return both_succeed + real_only + other_only + both_fail; }
};

/// One point of the scatter: a policy on a task, its rates over the pairs that count in both worlds.
struct ComparedPoint {
  std::string task, policy;
  std::string letter;  ///< "a", "b", …: its name in the chart
  Estimate real, other;
};

struct WorldComparison {
  std::string real, other;  ///< the worlds' names
  std::vector<ComparedPoint> points;
  std::vector<PairTable> tables;
  CorrelationGroup correlation;           ///< over all points: what `evac correlate` says of this world
  std::vector<CorrelationGroup> by_task;  ///< within each task, where the run has several
  Estimate agreement;  ///< share of all counted pairs with the same outcome, clustered by initial state
  std::vector<TaskOutcomes> by_state;  ///< what `correlation` was resampled from, a task each
};

/// What is compared, and in which order it is shown.
struct ComparedWorlds {
  std::string real, other;
  std::vector<std::string> tasks, policies;  ///< policies with their checkpoints
};

/// @param episodes  in pair-key order, of any worlds.
WorldComparison Compare(const std::vector<JudgedEpisode>& episodes, const ComparedWorlds& worlds,
                        const BootstrapOptions& bootstrap);

/// "a" … "z", "aa", "ab", …: the name of a point.
std::string PointLetter(std::size_t index);

/// Points of which only the rates are known (reports/pairs_csv.h), as the chart and the tables of a comparison show
/// them.
WorldComparison AsComparison(const CorrelationGroup& group);

/// The success rate over episodes that count, clustered by (task, initial state). @returns undefined without any.
Estimate RateOf(const std::vector<const JudgedEpisode*>& episodes, double confidence);

}  // namespace evac
