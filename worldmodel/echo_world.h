#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/recording.h"
#include "core/world.h"

namespace evac {

/// The recording that an initial state of a task is the start of. @throws Error if there is none.
using RecordedStart = std::function<Recording(const Task& task, const InitialState& initial)>;

/// Answers any commands with a recording's frames in time order, or with its frozen first one where there are none; the
/// last frame stays when they run out. It predicts nothing: it proves a format reader, a policy's wire and the loop on
/// real robot data.
///
/// Observed arms are the commanded ones and say so; at Reset they are the recorded start. There is no physics, so no
/// privileged track. Every scene walks through the recording on its own.
class EchoWorld : public World {
 public:
  /// Reads what is meant for each episode. @param find  may throw Error: there is none
  EchoWorld(RecordedStart find, std::string name);
  explicit EchoWorld(Recording recording, std::string name = "echo");
  /// Several at once: a task's id says which is meant. @throws InvalidInput if two have one id
  EchoWorld(std::vector<Recording> recordings, std::string name);

  std::string Name() const override { return name_; }

  /// @param task  its id (where there are several recordings, one of each task), its arms and its cameras' names and
  ///   sizes must be the recording's (TaskFromRecording). `seed` changes nothing.
  /// @throws InvalidInput if they are not.
  WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) override;

  /// A video that turns out to be broken fails its scene with world_error.
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override;

 private:
  RecordedStart find_;
  std::string name_;
  std::map<SceneId, RecordedFrames> scenes_;
};

}  // namespace evac
