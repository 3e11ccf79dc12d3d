#pragma once

#include <optional>

#include "core/types.h"
#include "policies/visual_things.h"

/// What the policies that come with evac share: poses of a gripper, and a camera's picture as a View.
namespace evac {

/// The gripper's z straight down, its x at `yaw_rad` about the vertical.
Eigen::Isometry3d PointingDown(const Eigen::Vector2d& xy_m, double z_m, double yaw_rad);

/// The nearest pose in the workspace: a degraded policy misses, but asks for nothing that is refused.
Eigen::Isometry3d Inside(Eigen::Isometry3d base_from_gripper, const Eigen::AlignedBox3d& workspace_m);

/// An arm that stays where it is; a hand that is closed around something keeps pressing.
ArmState Held(ArmState arm);

/// The camera's picture, its calibration at the picture's size, and its pose; nothing if the task has no such camera.
/// The view points into `observation`.
std::optional<View> ViewOf(const char* camera, const Task& task, const Observation& observation);

}  // namespace evac
