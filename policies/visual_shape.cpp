#include "policies/visual_shape.h"

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/geometry.h"

namespace evac {
namespace {

constexpr int kFiner = 4;           // silhouettes are drawn this much larger, then averaged down
constexpr int kRingPoints = 16;
constexpr double kFinestShare = 0.02;  // of the first step

/// The part's outline in the enlarged picture, or nothing if a point is behind the camera.
std::vector<cv::Point> Outline(const ConvexPart& part, const Camera& camera, const Eigen::Isometry3d& camera_from_object) {
  std::vector<cv::Point> corners;
  for (const Eigen::Vector3d& point_m : part.points_m) {
    const std::optional<Eigen::Vector2d> pixel = Project(camera, camera_from_object * point_m);
    if (!pixel || pixel->cwiseAbs().maxCoeff() > 1e4) return {};
    corners.emplace_back(static_cast<int>(std::lround(kFiner * pixel->x() - 0.5)),
                         static_cast<int>(std::lround(kFiner * pixel->y() - 0.5)));
  }
  std::vector<cv::Point> outline;
  cv::convexHull(corners, outline);
  return outline;
}

}  // namespace

ConvexPart Frustum(double low_m, double low_radius_m, double high_m, double high_radius_m) {
  ConvexPart part;
  for (int i = 0; i < kRingPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / kRingPoints;
    const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0);
    part.points_m.push_back(low_radius_m * out + low_m * Eigen::Vector3d::UnitZ());
    part.points_m.push_back(high_radius_m * out + high_m * Eigen::Vector3d::UnitZ());
  }
  return part;
}

ConvexPart Cuboid(const Eigen::Vector3d& min_m, const Eigen::Vector3d& max_m) {
  ConvexPart part;
  for (int corner = 0; corner < 8; ++corner) {
    part.points_m.emplace_back(corner & 1 ? max_m.x() : min_m.x(), corner & 2 ? max_m.y() : min_m.y(),
                               corner & 4 ? max_m.z() : min_m.z());
  }
  return part;
}

cv::Mat Silhouette(const Shape& shape, const Camera& camera, const Eigen::Isometry3d& camera_from_object) {
  cv::Mat1b fine(kFiner * camera.height_px, kFiner * camera.width_px, static_cast<uchar>(0));
  for (const ConvexPart& part : shape) {
    const std::vector<cv::Point> outline = Outline(part, camera, camera_from_object);
    if (outline.empty()) return cv::Mat1f(camera.height_px, camera.width_px, 0.f);
    cv::fillConvexPoly(fine, outline, part.coloured ? 255 : 0);
  }
  cv::Mat small, cover;
  cv::resize(fine, small, {camera.width_px, camera.height_px}, 0, 0, cv::INTER_AREA);
  small.convertTo(cover, CV_32F, 1.0 / 255);
  return cover;
}

double Overlap(const cv::Mat& a, const cv::Mat& b) {
  const double either = cv::sum(cv::max(a, b))[0];
  return either > 0 ? cv::sum(cv::min(a, b))[0] / either : 0;
}

Eigen::Isometry3d BaseFromObject(const Placement& placement, double height_m) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(placement.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  pose.translation() << placement.xy_m, height_m;
  return pose;
}

ShapeFit FitShape(const cv::Mat& cover, const Shape& shape, const Camera& camera, const Eigen::Isometry3d& base_from_camera,
                  const ShapeFit& start, const FitOptions& options) {
  const Eigen::Isometry3d camera_from_base = base_from_camera.inverse();
  const auto fit_at = [&](const Eigen::Vector3d& p) {
    const Placement placement{p.head<2>(), p.z()};
    return Overlap(cover, Silhouette(shape, camera, camera_from_base * BaseFromObject(placement, options.height_m)));
  };
  Eigen::Vector3d best(start.placement.xy_m.x(), start.placement.xy_m.y(), start.placement.yaw_rad);
  double overlap = fit_at(best);
  Eigen::Vector3d step(options.reach_m, options.reach_m, options.reach_yaw_rad);
  for (double share = 1; share >= kFinestShare;) {
    bool climbed = false;
    for (int i = 0; i < 6; ++i) {
      const int axis = i / 2;
      if (step[axis] == 0) continue;
      Eigen::Vector3d candidate = best;
      candidate[axis] += (i % 2 == 0 ? share : -share) * step[axis];
      const double found = fit_at(candidate);
      if (found <= overlap) continue;
      best = candidate;
      overlap = found;
      climbed = true;
    }
    if (!climbed) share /= 2;
  }
  return {{best.head<2>(), best.z()}, overlap};
}

}  // namespace evac
