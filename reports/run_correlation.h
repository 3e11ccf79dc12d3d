#pragma once

#include <string>
#include <vector>

#include "core/store.h"
#include "reports/correlation.h"

namespace evac {

struct RunCorrelationOptions {
  CorrelationOptions correlation;
  std::string judge = "oracle";  ///< whose current verdicts are counted
  std::string world;             ///< compare only this one with the real world; empty: every other
};

/// The real world against each other world of a run: a group per world ("sim") and, where the run has several tasks,
/// one per world and task ("sim/take_bottle").
///
/// A point is a policy on a task. Its rates count the pairs of episodes with one pair key (initial state, seed) that
/// have a verdict of success or failure in both worlds: cannot_tell, invalid, failed and unpaired episodes are in
/// neither rate. A point without any such pair is left out and named in `left_out`.
/// @throws InvalidInput if the run has no real world, no other, not the one asked for, or no verdict of the judge.
std::vector<CorrelationGroup> CorrelateRun(const Store& store, const RunCorrelationOptions& options = {});

}  // namespace evac
