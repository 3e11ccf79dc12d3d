#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/policy.h"
#include "core/store.h"
#include "core/world.h"
#include "harness/job.h"
#include "harness/lane.h"

namespace evac {

/// What is going on, for whoever shows it. A snapshot: owns what it says.
struct Progress {
  struct LaneState {
    std::string episode_id;
    int chunks = 0;
    int max_chunks = 0;
  };
  int done = 0;    ///< episodes of this call stored, failed ones too
  int failed = 0;  ///< of those, the failed
  std::vector<LaneState> lanes;
};

struct RolloutOptions {
  int lanes = 4;           ///< episodes that advance together; no result depends on it
  LaneOptions lane;
  int failures_left = 1;   ///< stop when more episodes than this have failed
  std::function<void(const Progress&)> on_progress;  ///< after every chunk; may be empty
  std::function<bool()> interrupted;                 ///< asked after every answer and every chunk; may be empty
  std::function<void()> check_policy = {};  ///< called after every answer of the policy's; what it throws ends the run
};

struct Summary {
  int done = 0;
  int failed = 0;
  bool interrupted = false;   ///< by the user: what was running is not stored and runs again on resume
  bool budget_spent = false;  ///< more failures than `failures_left`
  std::string last_failure;   ///< the reason of the last failed episode
};

/// The only loop: pairs a policy with a world until no job is left. Each finished episode is stored at once, with its video.
///
/// An episode's result is the same, bit for bit, for any number of lanes, any company, order or resume, as long as the
/// policy and the world keep their contracts. A failed episode is a row with a reason; it ends no other. One that the
/// store has and that runs again keeps its row until the new try is over.
/// @throws Error if nothing can be kept any more: the disk is full or gone; if a file of the suite's was written to since
///   it was read; what `check_policy` throws. No episode is blamed for that, and none that was running is kept.
Summary RunEpisodes(Policy& policy, World& world, JobQueue& jobs, Store& store, const RolloutOptions& options);

}  // namespace evac
