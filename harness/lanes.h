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

  /// Free lanes take the next jobs: Reset on both sides. @returns the number of lanes that hold an episode.
  int Refill(JobQueue& jobs, Policy& policy, World& world);

  /// The newest observation of every live lane, in lane order.
  std::vector<SceneObservation> Observed() const;
  void Command(const std::vector<Acted>& answers);

  /// The chunk of every lane that is still live after Command.
  std::vector<SceneChunk> Commanded() const;
  void Observe(const std::vector<Advanced>& answers);

  /// Ends every live lane with the same failure: the policy or the world broke as a whole.
  void FailAll(const Failure& failure);

  /// The episodes that are over, their videos finished; their lanes are free.
  std::vector<EpisodeRecord> TakeFinished();

  std::vector<Progress::LaneState> State() const;

 private:
  std::vector<Lane*> Live() const;

  Store& store_;
  const RolloutOptions& options_;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace evac
