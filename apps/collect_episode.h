#pragma once

#include <filesystem>

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

/// Runs episodes of a recipe one after the other, in a world of its own.
class EpisodeCollector {
 public:
  /// @param recipe  outlives this. @throws Error if the profile is wrong or there is no OpenGL.
  EpisodeCollector(const Recipe& recipe, std::filesystem::path out);

  /// Runs the job's episode and writes all of it, its row last; then the row is complete.
  CollectedEpisode Collect(const CollectJob& job);

 private:
  CollectedRun Run(const CollectJob& job);

  const Recipe& recipe_;
  std::filesystem::path out_;
  sim::MujocoWorld world_;
};

/// Where an episode of the collection lies.
TreePlace PlaceOf(const std::filesystem::path& out, const CollectedEpisode& row);

}  // namespace evac
