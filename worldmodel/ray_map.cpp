#include "worldmodel/ray_map.h"

namespace evac {

Eigen::Matrix3f ScaledIntrinsics(const Eigen::Matrix3f& intrinsics, double x_factor, double y_factor) {
  Eigen::Matrix3f scaled = intrinsics;
  scaled.row(0) *= static_cast<float>(x_factor);
  scaled.row(1) *= static_cast<float>(y_factor);
  return scaled;
}

RayMap MakeRayMap(const Eigen::Matrix3f& intrinsics, const Eigen::Matrix4f& base_from_camera, int height, int width) {
  RayMap rays{height, width, std::vector<float>(static_cast<std::size_t>(3 * height * width)),
              base_from_camera.topRightCorner<3, 1>()};
  const Eigen::Matrix3f rotation = base_from_camera.topLeftCorner<3, 3>();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3f in_camera((static_cast<float>(x) + 0.5F - intrinsics(0, 2)) / intrinsics(0, 0),
                                      (static_cast<float>(y) + 0.5F - intrinsics(1, 2)) / intrinsics(1, 1), 1);
      const Eigen::Vector3f direction = (rotation * in_camera).normalized();
      for (int axis = 0; axis < 3; ++axis)
        rays.direction[static_cast<std::size_t>((axis * height + y) * width + x)] = direction[axis];
    }
  }
  return rays;
}

}  // namespace evac
