#include "core/geometry.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "core/error.h"

namespace evac {

Eigen::Isometry3d BaseFromCamera(const Camera& camera, const Arms& arms) {
  if (camera.mount == Mount::kBase) return camera.mount_from_camera;
  if (arms.empty()) throw InternalError("camera {} is mounted on a gripper, but there are no arms", camera.name);
  const bool is_left = camera.mount == Mount::kLeftGripper;
  if (is_left && arms.size() == 1)
    throw InvalidInput("camera {} is mounted on the left gripper, but the robot has one arm, the right", camera.name);
  const ArmState& arm = is_left ? arms.front() : arms.back();
  return arm.base_from_gripper * camera.mount_from_camera;
}

std::optional<Eigen::Vector2d> Project(const Camera& camera, const Eigen::Vector3d& p) {
  if (p.z() <= 1e-6) return std::nullopt;
  return Eigen::Vector2d(camera.fx_px * p.x() / p.z() + camera.cx_px, camera.fy_px * p.y() / p.z() + camera.cy_px);
}

Eigen::Vector3d Ray(const Camera& camera, const Eigen::Vector2d& pixel) {
  return Eigen::Vector3d((pixel.x() - camera.cx_px) / camera.fx_px, (pixel.y() - camera.cy_px) / camera.fy_px, 1)
      .normalized();
}

Camera Resized(const Camera& camera, int width_px, int height_px) {
  const double x = static_cast<double>(width_px) / camera.width_px;
  const double y = static_cast<double>(height_px) / camera.height_px;
  Camera resized = camera;
  resized.width_px = width_px;
  resized.height_px = height_px;
  resized.fx_px *= x;
  resized.cx_px *= x;
  resized.fy_px *= y;
  resized.cy_px *= y;
  return resized;
}

Eigen::Isometry3d FromXyzQuat(const Eigen::Vector3d& xyz_m, const Eigen::Vector4d& quat_xyzw) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(quat_xyzw[3], quat_xyzw[0], quat_xyzw[1], quat_xyzw[2]).normalized().toRotationMatrix();
  pose.translation() = xyz_m;
  return pose;
}

double RotationBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear()));
}

std::string CalibrationDifference(const Camera& known, const Camera& asked, const std::string& where) {
  const double wide = asked.fx_px / asked.width_px, high = asked.fy_px / asked.height_px,
               known_wide = known.fx_px / known.width_px, known_high = known.fy_px / known.height_px;
  const double moved_m = (known.mount_from_camera.inverse() * asked.mount_from_camera).translation().norm(),
               turned_rad = RotationBetween(known.mount_from_camera, asked.mount_from_camera);
  if (known.mount != asked.mount) return "is mounted elsewhere";
  if (std::abs(wide / known_wide - 1) > kSameFocal)
    return fmt::format("has a focal length of {:.3f} picture widths, {} {:.3f}", wide, where, known_wide);
  if (std::abs(high / known_high - 1) > kSameFocal)
    return fmt::format("has a focal length of {:.3f} picture heights, {} {:.3f}", high, where, known_high);
  if (moved_m > kSameMount_m || turned_rad > kSameMount_rad)
    return fmt::format("stands {:.3f} m and {:.1f} degrees from where it stood {}", moved_m,
                       turned_rad * 180 / std::numbers::pi, where);
  return "";
}

}  // namespace evac
