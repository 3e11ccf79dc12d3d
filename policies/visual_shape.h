#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/types.h"

/// Where a thing of known shape stands, from how much of its colour each pixel of one picture holds.
namespace evac {

/// A convex solid, by points whose hull it is, in the object's frame (metres, z up, origin on the ground below it).
struct ConvexPart {
  std::vector<Eigen::Vector3d> points_m;
  bool coloured = true;  ///< false: it hides what was drawn before it, e.g. a bottle's white cap
};

/// Drawn part after part, so the nearer one comes later. Only for cameras that look down on it.
using Shape = std::vector<ConvexPart>;

/// The hull of two horizontal rings around the z axis.
ConvexPart Frustum(double low_m, double low_radius_m, double high_m, double high_radius_m);
ConvexPart Cuboid(const Eigen::Vector3d& min_m, const Eigen::Vector3d& max_m);

/// How much of each pixel a shape covers, CV_32F in [0, 1]. All 0 if a point of it is behind the camera.
cv::Mat Silhouette(const Shape& shape, const Camera& camera, const Eigen::Isometry3d& camera_from_object);

/// Of what two pictures of cover have in common: sum of minima over sum of maxima, [0, 1]; 0 if both are empty.
double Overlap(const cv::Mat& a, const cv::Mat& b);

/// A place on the table.
struct Placement {
  Eigen::Vector2d xy_m = Eigen::Vector2d::Zero();  ///< base frame
  double yaw_rad = 0;                              ///< about the vertical
};
Eigen::Isometry3d BaseFromObject(const Placement& placement, double height_m);

struct ShapeFit {
  Placement placement;
  double overlap = 0;  ///< [0, 1]: how well the silhouette there agrees with the picture
};

struct FitOptions {
  double reach_m = 0.02;     ///< first step of the search; the last is a fiftieth of it
  double reach_yaw_rad = 0;  ///< the same for the yaw; 0: the yaw stays as it is
  double height_m = 0;       ///< of the object's origin, base frame
};

/// The placement whose silhouette agrees best with `cover`: from the best of `start` and of those, at yaws up to thrice
/// the reach away, whose middle lies on the cover's, it climbs (pattern search after Hooke and Jeeves 1961: steps along
/// each coordinate, halved when none helps). Sub-pixel, since cover is a share and not a yes or no.
ShapeFit FitShape(const cv::Mat& cover, const Shape& shape, const Camera& camera,
                  const Eigen::Isometry3d& base_from_camera, const ShapeFit& start, const FitOptions& options);

}  // namespace evac
