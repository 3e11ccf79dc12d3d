#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "apps/collect_recipe.h"
#include "core/world.h"
#include "worldmodel/sim/mujoco_world.h"

namespace evac {

/// One attempt, as it happened.
struct CollectedRun {
  RecordedEpisode recorded;
  PrivilegedTrack track;
  std::string stop;     ///< still, max_chunks or diverged
  std::string failure;  ///< the message of one that diverged, else empty
};

/// What came of it when the arms were told that, with nobody looking.
struct UnseenRun {
  PrivilegedTrack track;  ///< [T]
  bool success = false;   ///< by the oracle
};

/// Does in the scene of a collected episode what the arms are told, without pictures, for which it takes a fraction of the
/// time.
class EpisodeRepeater {
 public:
  /// @param recipe  outlives this. @throws Error if the profile is wrong or there is no OpenGL.
  explicit EpisodeRepeater(const Recipe& recipe);

  /// @param told  [T], T >= 2; row 0, where the arms were, is not executed
  /// @returns     nothing if no world should do that (WhatIsWrong) or the physics failed
  std::optional<UnseenRun> Do(const CollectJob& job, const std::vector<Arms>& told);

 private:
  sim::MujocoWorld world_;
};

/// The task as the job's episode found it, its object taken away or not.
const Task& TaskOf(const CollectJob& job);

/// Where the middle of the task's object is in a camera's picture, pixels; nothing if it is behind the camera.
std::optional<Eigen::Vector2d> ObjectIn(const CollectJob& job, const Camera& camera, const PrivilegedFrame& frame);

/// Runs episodes of a recipe one after the other, in a world of its own.
class EpisodeCollector {
 public:
  /// @param recipe  outlives this. @throws Error if the profile is wrong or there is no OpenGL.
  EpisodeCollector(const Recipe& recipe, std::filesystem::path out);

  /// Runs the job's episode and writes all of it, its row last; then the row is complete.
  CollectedEpisode Collect(const CollectJob& job);

 private:
  CollectedRun Run(const CollectJob& job);
  CollectedRun Act(const CollectJob& job, const Task& task);
  /// What was told in `before`, once more in the scene of `task`.
  CollectedRun Repeat(const CollectJob& job, const Task& task, const CollectedRun& before);
  Observation Begin(const CollectJob& job, const Task& task, CollectedRun& run);
  /// @returns what was observed on the way, the last with its images; nothing if the physics failed: the run says so.
  std::optional<std::vector<Observation>> Execute(const ActionChunk& chunk, CollectedRun& run);

  const Recipe& recipe_;
  std::filesystem::path out_;
  sim::MujocoWorld world_;
};

/// Where an episode of the collection lies.
TreePlace PlaceOf(const std::filesystem::path& out, const CollectedEpisode& row);

}  // namespace evac
