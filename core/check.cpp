#include "core/check.h"

#include <fmt/format.h>

namespace evac {
namespace {

std::optional<std::string> WhatIsWrong(const ArmState& arm, const Task& task) {
  const Eigen::Vector3d at_m = arm.base_from_gripper.translation();
  const Eigen::Matrix3d& rotation = arm.base_from_gripper.linear();
  if (!at_m.allFinite() || !rotation.allFinite()) return "the pose is not finite";
  if (!((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 && rotation.determinant() > 0)) {
    return "the orientation is no rotation";
  }
  if (!task.workspace_m.contains(at_m)) {
    const Eigen::Vector3d low = task.workspace_m.min(), high = task.workspace_m.max();
    return fmt::format("the position ({:.3f}, {:.3f}, {:.3f}) m is outside the workspace ({:.2f}, {:.2f}, {:.2f}) … ({:.2f}, {:.2f}, {:.2f}) m",
                       at_m.x(), at_m.y(), at_m.z(), low.x(), low.y(), low.z(), high.x(), high.y(), high.z());
  }
  if (!(arm.closure >= 0 && arm.closure <= 1)) return fmt::format("the closure {} is outside 0 (open) … 1 (closed)", arm.closure);
  return std::nullopt;
}

std::optional<std::string> WhatIsWrong(const Arms& arms, const Task& task) {
  if (arms.size() != task.arms.size()) return fmt::format("it has {} arms, the task {}", arms.size(), task.arms.size());
  for (std::size_t i = 0; i < arms.size(); ++i) {
    if (const auto wrong = WhatIsWrong(arms[i], task)) return fmt::format("{} arm: {}", task.arms[i], *wrong);
  }
  return std::nullopt;
}

/// A measured arm may be outside the workspace that commands must keep to.
std::optional<std::string> WhatIsWrongAnywhere(const Arms& arms, const Task& task) {
  Task anywhere = task;
  anywhere.workspace_m = Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-1e3), Eigen::Vector3d::Constant(1e3));
  return WhatIsWrong(arms, anywhere);
}

}  // namespace

std::optional<std::string> WhatIsWrong(const ActionChunk& chunk, const Task& task, int max_targets) {
  const int count = static_cast<int>(chunk.targets.size());
  if (count < 1 || count > max_targets) return fmt::format("the chunk has {} targets, wanted 1 … {}", count, max_targets);
  for (int k = 0; k < count; ++k) {
    if (const auto wrong = WhatIsWrong(chunk.targets[k], task)) return fmt::format("target {} of {}: {}", k, count, *wrong);
  }
  return std::nullopt;
}

std::optional<std::string> WhatIsWrong(const Observation& observation, const Task& task) {
  if (observation.images.size() != task.cameras.size()) {
    return fmt::format("the observation has {} images, the task {} cameras", observation.images.size(), task.cameras.size());
  }
  for (std::size_t i = 0; i < task.cameras.size(); ++i) {
    const cv::Mat& image = observation.images[i];
    const Camera& camera = task.cameras[i];
    if (image.type() != CV_8UC3 || image.cols != camera.width_px || image.rows != camera.height_px) {
      return fmt::format("the image of camera {} is {}x{} with {} channels, wanted {}x{} RGB", camera.name, image.cols, image.rows,
                         image.channels(), camera.width_px, camera.height_px);
    }
  }
  return WhatIsWrongAnywhere(observation.arms, task);
}

std::optional<std::string> WhatIsWrongUnseen(const Observation& observation, const Task& task) {
  if (!observation.images.empty())
    return fmt::format("the observation has {} images, wanted none: the world is not filmed", observation.images.size());
  return WhatIsWrongAnywhere(observation.arms, task);
}

}  // namespace evac
