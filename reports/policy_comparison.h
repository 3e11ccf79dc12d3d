#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/planning.h"
#include "core/statistics/rates.h"
#include "reports/outcome.h"

/// Which of two policies is better, and how sure: per task and over all tasks (docs/statistics.md). Paired by initial
/// state and seed wherever at least 80 % of them are shared. Repeats of an initial state are not new states: rates are
/// of all episodes; intervals, tests and plans of what these tell as much as. Output: policy_comparison_output.h.
namespace evac {

/// One policy's episodes in one world.
struct ComparedPolicy {
  std::string name;  ///< "visual_pick@good"
  std::vector<JudgedEpisode> episodes;
};

struct ComparisonOptions {
  double alpha = 0.05;  ///< two-sided; over tasks after Holm
  double power = 0.8;   ///< of the sizes that "how many more" promises
  double confidence() const { return 1 - alpha; }
};

enum class Winner { kFirst, kSecond, kNotDecided };

/// One task, or all of them.
struct ComparisonRow {
  std::string task;        ///< empty: all tasks, stratified
  Estimate first, second;  ///< success rates; over the shared pairs where paired, else over all that count
  std::int64_t first_episodes = 0, second_episodes = 0, shared = 0;  ///< that count, and with one (state, seed)
  Repeated pairs;                                  ///< the shared ones, where paired
  Repeated first_trials, second_trials;            ///< the episodes that count, where not
  std::int64_t first_apart = 0, second_apart = 0;  ///< errors, cannot tell, invalid, not judged: in no rate
  bool is_paired = false;
  Flips flips;          ///< of the shared pairs
  Estimate difference;  ///< first - second
  Number stratified_se = Undefined{"not stratified"};  ///< of the difference, where tasks are strata
  std::string test;     ///< "exact McNemar", "Boschloo on 4 and 6 effective episodes", "Newcombe" (of many:
                        ///< two_samples.h), "Cochran-Mantel-Haenszel"
  Number p = Undefined{"no episodes to compare"};
  Number p_holm = Undefined{"no episodes to compare"};  ///< over the tasks shown; of all tasks: p itself
  Winner winner = Winner::kNotDecided;
  Defined<std::int64_t> more = Undefined{"decided"};  ///< further pairs, or episodes per policy, that would decide with
                                                      ///< the power asked for if the rates are those seen; of one among
                                                      ///< several tasks at its share of alpha
};

/// How many further pairs, or episodes of each policy, would show the difference at two-sided `alpha` with this power, if
/// the rates are those seen and further ones repeat states as these do. Of a stratified difference: each task's episodes
/// grow alike. For whoever adjusts p over several comparisons: at its share of alpha.
Defined<std::int64_t> MoreToDecide(const ComparisonRow& row, const Promise& promise);

struct PolicyComparison {
  std::string first, second;
  ComparisonOptions options;
  std::vector<ComparisonRow> tasks;   ///< in the order of their names
  ComparisonRow all;                  ///< over the tasks with episodes of both; equal to the task where there is one
  std::vector<std::string> left_out;  ///< tasks that are not in `all`: one of the two has no episode there that counts
};

/// @throws InvalidInput if alpha or power is not in (0, 1), or neither policy has an episode.
PolicyComparison ComparePolicies(const ComparedPolicy& first, const ComparedPolicy& second,
                                 const ComparisonOptions& options = {});

}  // namespace evac
