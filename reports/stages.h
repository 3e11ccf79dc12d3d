#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/mcnemar.h"
#include "reports/summary.h"

/// How far episodes come, stage after stage (reach → grasp → lift → place → release), and at which stage a world parts
/// from the real one: a world that lets grasps hold that would have slipped shows it here, not in the success rate.
namespace evac {

/// One (task, policy, world): the share of its episodes that reached each stage and every stage before it.
struct StageRow {
  std::string world;
  std::vector<Estimate> reached;  ///< [stages], never rising; Wilson, clustered by initial state
};

struct StageFunnel {
  std::string task, policy;         ///< policy with its checkpoint
  std::vector<std::string> stages;  ///< in the rubric's order
  std::vector<StageRow> worlds;     ///< the real one first, then in the order declared; only those with episodes
};

/// Pairs that were together until this stage, and then only one of the two went on.
struct StageParting {
  std::string task, stage, world;
  std::int64_t pairs = 0;            ///< that both reached every stage before it
  Flips flips;                       ///< only_first: the world under test went on; only_second: the real one did
  std::int64_t effective_pairs = 0;  ///< what `pairs` tell as much as: policies and seeds share initial states
  Number p = Undefined{"no pair came so far"};       ///< exact McNemar on the effective pairs
  Number p_holm = Undefined{"no pair came so far"};  ///< over the stages and tasks of this world
};

struct StageReport {
  std::vector<StageFunnel> funnels;    ///< by task, then policy
  std::vector<StageParting> partings;  ///< by world, task, stage
  std::int64_t episodes = 0;           ///< with a verdict that tells stages
};

/// From the verdicts of the judge that is counted; empty where it tells no stages.
StageReport StagesOf(const RunSummary& summary);

/// "sim is kinder than real at grasp: 14 pairs went on in sim alone, 3 in real alone (of 80; exact McNemar p = 0.01
/// after Holm)."; with "not decided" where the test does not tell.
std::string PartingInWords(const StageParting& parting, const std::string& reference);

}  // namespace evac
