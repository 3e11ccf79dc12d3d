#include "policies/gripper_poses.h"

#include "core/geometry.h"

namespace evac {
namespace {

constexpr double kMargin_m = 0.005;  // targets keep this far within the workspace

}  // namespace

Eigen::Isometry3d PointingDown(const Eigen::Vector2d& xy_m, double z_m, double yaw_rad) {
  Eigen::Isometry3d pose = BaseFromObject({xy_m, yaw_rad}, z_m);
  pose.linear() = pose.linear() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return pose;
}

Eigen::Isometry3d Inside(Eigen::Isometry3d pose, const Eigen::AlignedBox3d& workspace_m) {
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(kMargin_m);
  pose.translation() = pose.translation().cwiseMax(workspace_m.min() + margin).cwiseMin(workspace_m.max() - margin);
  return pose;
}

ArmState Held(ArmState arm) {
  arm.closure = arm.closure > 0.5 ? 1.0 : 0.0;
  return arm;
}

std::optional<View> ViewOf(const char* camera, const Task& task, const Observation& observation) {
  for (std::size_t i = 0; i < task.cameras.size() && i < observation.images.size(); ++i) {
    if (task.cameras[i].name != camera) continue;
    const cv::Mat& rgb = observation.images[i];
    return View{&rgb, Resized(task.cameras[i], rgb.cols, rgb.rows), BaseFromCamera(task.cameras[i], observation.arms)};
  }
  return std::nullopt;
}

}  // namespace evac
