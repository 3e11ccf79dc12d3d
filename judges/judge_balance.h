#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/bootstrap.h"
#include "core/statistics/threshold.h"
#include "core/store.h"

/// Where a judge's threshold lies best for clips that a world model imagined: paired runs know what truly happened.
namespace evac {

/// An imagined clip and its pair in the real world.
struct PairedClip {
  std::string state;       ///< task and initial state: what is drawn anew by the bootstrap
  double probability = 0;  ///< of success, as the judge gave it for the imagined clip
  bool succeeded = false;  ///< in the real world
  std::string video_sha256;
};

struct PairedClips {
  std::string world;  ///< whose clips they are
  std::vector<PairedClip> clips;
  std::int64_t left_out = 0;  ///< judged clips without a probability, or whose pair did not succeed or fail by the truth
};

/// Episodes of a world that is not real, which a judge gave a probability, and whose pair in the real world succeeded or
/// failed by `truth`. Episodes that failed are not among them.
/// @param world  empty: the one world that is not real of which the judge has verdicts
/// @throws InvalidInput if the run has no real world, the world is none, real, or not judged; or, unnamed, one of several.
PairedClips PairedClipsOf(const Store& store, const std::string& judge, const std::string& truth, const std::string& world);

/// The threshold at which as large a share of failures is called successes as of successes failures, or comes closest to
/// that: the middle, by logit, of the gap between two clips. Not of a grid, as core/statistics/threshold.h has it: a judge
/// that is surer than it should be has it close to 1. Interval: percentile bootstrap over states, so that
/// it says how much other initial states could move it. Both undefined where all outcomes or all probabilities are alike.
Estimate BalanceOf(const std::vector<PairedClip>& clips, const BootstrapOptions& options = {.replicates = 1000});

/// What comes of a threshold on such clips.
Confusion ConfusionAt(const std::vector<PairedClip>& clips, double threshold);

}  // namespace evac
