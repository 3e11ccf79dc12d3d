#pragma once

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "core/geometry.h"
#include "core/task_page.h"
#include "worldmodel/sim/mujoco_world.h"

namespace evac::test {

inline std::filesystem::path ProfilePage(const std::string& name) {
  return std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/profiles" / (name + ".yaml");
}

inline sim::MujocoWorld MakeWorld(const std::string& profile, int threads = 1) {
  return sim::MujocoWorld({profile, ProfilePage(profile), threads});
}

inline std::filesystem::path SceneFolder() {
  return std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes";
}

inline Task ReadTask(const std::string& id) { return ReadTaskPage(SceneFolder() / (id + ".yaml")); }

/// The task with pictures too small to cost anything, for tests that do not look at them.
inline Task WithTinyPictures(Task task) {
  for (Camera& camera : task.cameras) camera = Resized(camera, 12, 8);
  return task;
}

inline InitialState State(std::uint64_t seed) { return {"test-" + std::to_string(seed), seed}; }

/// One scene's answer. @throws std::bad_variant_access if it failed.
inline std::vector<WorldStep> Advance(World& world, SceneId scene, const std::vector<Arms>& targets) {
  const ActionChunk chunk{targets, false};
  const SceneChunk item{scene, &chunk};
  return std::get<std::vector<WorldStep>>(std::move(world.Advance({&item, 1})[0]));
}

/// Every byte that a policy could see.
inline std::string Bytes(const WorldStep& step) {
  std::string bytes;
  for (const cv::Mat& image : step.observation.images)
    bytes.append(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
  for (const ArmState& arm : step.observation.arms) {
    const Eigen::Matrix4d pose = arm.base_from_gripper.matrix();
    bytes.append(reinterpret_cast<const char*>(pose.data()), sizeof(double) * 16);
    bytes.append(reinterpret_cast<const char*>(&arm.closure), sizeof(double));
  }
  return bytes;
}

inline std::string Bytes(const std::vector<WorldStep>& steps) {
  std::string bytes;
  for (const WorldStep& step : steps) bytes += Bytes(step);
  return bytes;
}

}  // namespace evac::test
