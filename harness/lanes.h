#pragma once

#include <memory>
#include <vector>

#include "harness/lane.h"
#include "harness/rollout.h"

namespace evac {

/// The episodes that advance together. A lane is free, or holds one running episode.
class Lanes {
 public:
  Lanes(Store& store, const RolloutOptions& options) : store_(store), options_(options), lanes_(options.lanes) {}

  /// Free lanes take the next jobs: Reset on both sides, of one at least, and of no more once the user wants an end.
  /// @returns the number of lanes that hold an episode: none where there is no job left.
  int Refill(JobQueue& jobs, Policy& policy, World& world);

  /// Asks the policy for all of them. What it throws is every live episode's failure.
  void Command(Policy& policy);

  /// Has the world execute the chunks of the lanes that are still live. What it throws is their failure; what the disk
  /// refuses is thrown here, and ends the run.
  void Observe(World& world);

  /// The episodes that are over, their videos finished; their lanes are free. Failed ones that these ran again for are
  /// removed from the store.
  std::vector<EpisodeRecord> TakeFinished();

  std::vector<Progress::LaneState> State() const;

 private:
  std::vector<Lane*> Live() const;
  void FailAll(const Failure& failure);

  Store& store_;
  const RolloutOptions& options_;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace evac
