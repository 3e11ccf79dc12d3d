#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"
#include "worldmodel/sim/arm_control.h"
#include "worldmodel/sim/profile.h"

namespace evac::sim {

/// What the calibration of one profile's rig does not know. A function of the profile alone.
struct HiddenErrors {
  std::vector<Joints> joint_offset;  ///< per arm of the task; radians, believed minus true
  std::vector<Eigen::Isometry3d>
      camera_from_true_camera;  ///< mount_from_true_camera = mount_from_camera * this, per camera
};
HiddenErrors DrawHiddenErrors(const Profile& profile, const Task& task);

/// Adds noise to `image` in place: about normal, in steps of a quarter of its deviation, independent per pixel and
/// channel.
void AddNoise(cv::Mat& image, double deviation_grey, std::uint64_t seed);
void AddNoise(ArmState& arm, const Profile::Sensors& sensors, std::uint64_t seed);

}  // namespace evac::sim
