#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "core/types.h"
#include "worldmodel/action_statistics.h"

/// Absolute gripper poses as the network reads them: as differences from frame to frame (EVAC, Sec. 3.2; numbers as the
/// reference: docs/evac_quirks.md).
namespace evac {

enum class Side { kLeft, kRight };

/// One gripper of one frame, base frame, in double as recorded.
struct GripperPose {
  Eigen::Vector3d xyz_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond base_from_gripper = Eigen::Quaterniond::Identity();  ///< of unit length
  double closure = 0;  ///< 0 open … 1 closed; readings beyond 120 are clamped where they are read
};

/// Left and right. With one arm the other stands still where `Task` has none: its deltas are zero.
using BothGrippers = std::array<GripperPose, 2>;

/// From the arms of an observation: {right}, or {left, right}.
BothGrippers GrippersOf(const Arms& arms);

/// 14 numbers: for left then right, xyz difference (3, metres), roll pitch yaw difference wrapped to (-pi, pi] (3,
/// radians), closure after the step (1).
using ActionDelta = std::array<double, 14>;

/// Roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll), in (-pi, pi], [-pi/2, pi/2], (-pi, pi]. At gimbal lock yaw is
/// 0.
Eigen::Vector3d RollPitchYaw(const Eigen::Quaterniond& rotation);

ActionDelta DeltaBetween(const BothGrippers& before, const BothGrippers& after);

/// From raw to network units; the closures stay. Statistics are per frame at 30 Hz, `stride` is how many of those a
/// step spans.
std::array<float, 14> Normalised(const ActionDelta& delta, const ActionStatistics& statistics, double stride);

}  // namespace evac
