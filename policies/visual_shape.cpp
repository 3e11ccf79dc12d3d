#include "policies/visual_shape.h"

#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/geometry.h"
#include "policies/perception.h"

namespace evac {
namespace {

constexpr int kFiner = 4;  // silhouettes are drawn this much larger, then averaged down
constexpr int kRingPoints = 16;
constexpr double kFinestShare = 0.02;  // of the first step

/// The part's outline in the enlarged picture, or nothing if a point is behind the camera.
std::vector<cv::Point> Outline(const ConvexPart& part, const Camera& camera,
                               const Eigen::Isometry3d& camera_from_object) {
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

namespace {

/// Weighted mean of the pixel centres, or nothing if there is nothing.
std::optional<Eigen::Vector2d> Centroid(const cv::Mat& cover) {
  const cv::Moments m = cv::moments(cover);
  if (m.m00 <= 0) return std::nullopt;
  return Eigen::Vector2d(m.m10 / m.m00 + 0.5, m.m01 / m.m00 + 0.5);
}

struct Viewpoint {
  const Camera& camera;
  const Eigen::Isometry3d& base_from_camera;
};

/// The search for one placement; vectors are x, y (metres) and yaw (radians).
struct Search {
  const cv::Mat& cover;
  const Shape& shape;
  Viewpoint view;
  const FitOptions& options;

  cv::Mat Drawn(const Eigen::Vector3d& p) const {
    return Silhouette(shape, view.camera,
                      view.base_from_camera.inverse() * BaseFromObject({p.head<2>(), p.z()}, options.height_m));
  }
  double OverlapAt(const Eigen::Vector3d& p) const { return Overlap(cover, Drawn(p)); }

  /// Moved so that the silhouette's middle lies on the cover's.
  Eigen::Vector3d Centred(Eigen::Vector3d p) const {
    const std::optional<Eigen::Vector2d> wanted_px = Centroid(cover), found_px = Centroid(Drawn(p));
    if (!wanted_px || !found_px) return p;
    const auto wanted_m = OnPlane(view.camera, view.base_from_camera, *wanted_px, options.height_m);
    const auto found_m = OnPlane(view.camera, view.base_from_camera, *found_px, options.height_m);
    if (wanted_m && found_m) p.head<2>() += (*wanted_m - *found_m).head<2>();
    return p;
  }

  /// The best of where one expects it and, for some yaws around that, where the middles agree.
  Eigen::Vector3d BestStart(const Placement& expected) const {
    Eigen::Vector3d best(expected.xy_m.x(), expected.xy_m.y(), expected.yaw_rad);
    for (const int turn : {0, -3, -2, -1, 1, 2, 3}) {
      const Eigen::Vector3d turned(expected.xy_m.x(), expected.xy_m.y(),
                                   expected.yaw_rad + turn * options.reach_yaw_rad);
      const Eigen::Vector3d centred = Centred(Centred(turned));
      if (OverlapAt(centred) > OverlapAt(best)) best = centred;
      if (options.reach_yaw_rad == 0) break;
    }
    return best;
  }

  ShapeFit Climb(Eigen::Vector3d best) const {
    double overlap = OverlapAt(best);
    const Eigen::Vector3d step(options.reach_m, options.reach_m, options.reach_yaw_rad);
    for (double share = 1; share >= kFinestShare;) {
      bool climbed = false;
      for (int i = 0; i < 6; ++i) {
        Eigen::Vector3d candidate = best;
        candidate[i / 2] += (i % 2 == 0 ? share : -share) * step[i / 2];
        const double found = OverlapAt(candidate);
        if (found <= overlap) continue;
        best = candidate;
        overlap = found;
        climbed = true;
      }
      if (!climbed) share /= 2;
    }
    return {{best.head<2>(), best.z()}, overlap};
  }
};

}  // namespace

ShapeFit FitShape(const cv::Mat& cover, const Shape& shape, const Camera& camera,
                  const Eigen::Isometry3d& base_from_camera, const ShapeFit& start, const FitOptions& options) {
  const Search search{cover, shape, {camera, base_from_camera}, options};
  return search.Climb(search.BestStart(start.placement));
}

}  // namespace evac
