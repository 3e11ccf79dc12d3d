#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "reports/policy_comparison.h"
#include "reports/summary.h"

/// Success rate against checkpoint: does training still help, and does a world show it?
namespace evac {

/// One checkpoint of a policy on one task.
struct CheckpointPoint {
  std::string checkpoint;
  double step = 0;             ///< the number its name ends with; its place in the suite where not all names have one,
                               ///< with the same before it (v1.9, v2.0; 2026-01-31, 2026-02-01)
  std::vector<Estimate> rate;  ///< [worlds of the curve]; undefined where it has no episode
};

struct CheckpointCurve {
  std::string task, policy;                           ///< policy without checkpoint
  bool has_steps = false;                             ///< whether `step` was read from the names
  std::vector<std::string> worlds;                    ///< the real one first
  std::vector<CheckpointPoint> points;                ///< by step; two or more
  std::vector<std::optional<PolicyComparison>> ends;  ///< [worlds] the last checkpoint (first) against the first one
};

/// Curves of every policy with two or more checkpoints, by policy, then task.
std::vector<CheckpointCurve> CheckpointsOf(const RunSummary& summary);

/// "In real, from good to bad: 90 % → 33 %, -57 points [-68, -43], p < 0.001 (exact McNemar, 20 pairs); 0 of 3 steps
/// rise." A step is from one checkpoint to the next where both have a rate.
std::string TrendInWords(const CheckpointCurve& curve, std::size_t world);

/// The number at the end of a checkpoint's name: "step_20000" → 20000, "120k" → 120000, "0.5M" → 500000, "good" → none.
/// Without a unit what is before a point is a version's: "v1.10" → 10.
std::optional<double> StepOf(const std::string& checkpoint);

}  // namespace evac
