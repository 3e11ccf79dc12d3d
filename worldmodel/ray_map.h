#pragma once

#include <Eigen/Core>
#include <vector>

namespace evac {

/// The camera as the network reads it: for each latent pixel the ray through its centre (EVAC, Sec. 3.2).
struct RayMap {
  int height = 0, width = 0;        ///< latent pixels
  std::vector<float> direction;     ///< [3, height, width]: unit length, base frame
  Eigen::Vector3f origin{0, 0, 0};  ///< the same for every pixel: the camera, metres, base frame
};

/// Intrinsics for a picture of another size; x and y on their own, no half-pixel shift, as in training.
Eigen::Matrix3f ScaledIntrinsics(const Eigen::Matrix3f& intrinsics, double x_factor, double y_factor);

/// @param intrinsics        pixels of the latent picture
/// @param base_from_camera  rotation and translation, metres
RayMap MakeRayMap(const Eigen::Matrix3f& intrinsics, const Eigen::Matrix4f& base_from_camera, int height, int width);

}  // namespace evac
