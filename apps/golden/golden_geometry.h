#pragma once

#include <Eigen/Core>
#include <array>

#include "apps/golden/golden_file.h"
#include "worldmodel/pose_map.h"
#include "worldmodel/ray_map.h"

/// Between tensors and what draws and projects.
namespace evac::golden {

Eigen::Matrix3f Matrix3(const Tensor& tensor);
Eigen::Matrix4f Matrix4(const Tensor& tensor);

/// A row of `action`: left xyz, quaternion xyzw as drawn, gripper; then right.
std::array<DrawnGripper, 2> GrippersOfAction(const Tensor& row);

/// As the reference draws, its quirks included.
PoseMapOptions ReferencePoseMap();

/// [H, W, 3] bytes.
Tensor AsTensor(const cv::Mat& picture);

struct Rays {
  Tensor direction, origin;  ///< [3, h, w]
};
Rays AsTensors(const RayMap& rays);

}  // namespace evac::golden
