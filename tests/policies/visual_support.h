#pragma once

#include <fmt/core.h>

#include <filesystem>
#include <vector>

#include "core/seed.h"
#include "core/task_page.h"
#include "judges/rubric.h"
#include "policies/visual_pick.h"
#include "worldmodel/sim/mujoco_world.h"

/// What the tests of `visual_pick` share: the MuJoCo world it was made for, and episodes in it without LCM or a store.
namespace evac {

inline const std::filesystem::path kSim = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel" / "sim";

inline Task SimTask(const std::string& id) { return ReadTaskPage(kSim / "scenes" / (id + ".yaml")); }

inline sim::MujocoWorld SimWorld(const std::string& profile) {
  return sim::MujocoWorld({.name = profile, .profile = kSim / "profiles" / (profile + ".yaml"), .threads = 2});
}

inline InitialState SimState(int index) {
  return {fmt::format("77-{:04d}", index), SeedFor(77, static_cast<std::uint64_t>(index))};
}

inline Eigen::Isometry3d PoseIn(const PrivilegedFrame& frame, const std::string& body) {
  for (const PrivilegedFrame::Body& found : frame.bodies) {
    if (found.name == body) return found.base_from_body;
  }
  throw InternalError("no body {} in the frame", body);
}

/// Whether the stages of the task were all reached: the oracle's rule on a track that is still in memory.
inline bool Succeeded(const Task& task, const PrivilegedTrack& track) {
  std::size_t from = 0;
  for (const Stage& stage : task.rubric.stages) {
    const StageOutcome outcome = Follow(stage, {track, task.period_s}, from);
    if (!outcome.reached) return false;
    from = outcome.at_frame;
  }
  return true;
}

/// How many of `count` initial states the policy masters. Scene i is initial state i with seed i, so two policies are
/// paired.
inline int Successes(World& world, Policy& policy, const Task& task, int count, int chunks) {
  std::vector<Observation> seen(count);
  std::vector<PrivilegedTrack> tracks(count);
  std::vector<SceneObservation> asked;
  for (int scene = 0; scene < count; ++scene) {
    const WorldStep first = world.Reset(scene, task, SimState(scene), 1);
    policy.Reset(scene, task, static_cast<std::uint64_t>(scene));
    seen[scene] = first.observation;
    tracks[scene].push_back(first.privileged);
    asked.push_back({scene, &seen[scene]});
  }
  for (int chunk = 0; chunk < chunks; ++chunk) {
    const std::vector<Acted> answers = policy.Act(asked);
    std::vector<SceneChunk> batch;
    for (int scene = 0; scene < count; ++scene) batch.push_back({scene, &std::get<ActionChunk>(answers[scene])});
    const std::vector<Advanced> advanced = world.Advance(batch);
    for (int scene = 0; scene < count; ++scene) {
      for (const WorldStep& step : std::get<std::vector<WorldStep>>(advanced[scene]))
        tracks[scene].push_back(step.privileged);
      seen[scene] = std::get<std::vector<WorldStep>>(advanced[scene]).back().observation;
    }
  }
  int successes = 0;
  for (const PrivilegedTrack& track : tracks) successes += Succeeded(task, track);
  return successes;
}

}  // namespace evac
