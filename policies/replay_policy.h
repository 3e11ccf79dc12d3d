#pragma once

#include <map>

#include "core/policy.h"
#include "core/recording.h"

namespace evac {

/// Plays a recorded trajectory: after the start (row 0), rows 1, 2, … in chunks, whatever it observes: where the arms
/// were told to be, if the recording was read with that (`Recording::told`), else where they were. The last chunk may
/// be shorter and ends the recording. Every target must be executed, so its declaration needs whole_chunks.
class ReplayPolicy : public Policy {
 public:
  /// @param recording   at least two steps.
  /// @param chunk_size  targets per chunk, > 0.
  /// @throws InvalidInput if there is nothing to play.
  ReplayPolicy(Recording recording, int chunk_size);

  std::string Name() const override { return "replay"; }
  /// @throws InvalidInput unless the task's arms and period are the recording's.
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;
  /// After the recording's end it fails: policy_error.
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  Acted Next(SceneId scene);

  Recording recording_;
  std::size_t chunk_size_;
  std::map<SceneId, std::size_t> next_row_;
};

}  // namespace evac
