#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/types.h"

/// What a policy without any learning can see: patches of a colour it knows by name, to a fraction of a pixel, and
/// where in the robot's base frame they are when their height is known. Works on small, noisy or blurred pictures:
/// nothing here looks at a single pixel alone, and thresholds follow the light.
namespace evac {

/// A colour by its hue and by how colourful it is, whatever the light's brightness.
struct ColourModel {
  double hue_deg = 0;             ///< [0, 360): 0 red, 120 green, 240 blue
  double hue_tolerance_deg = 20;  ///< beyond it a pixel is another colour
  double min_saturation = 0.25;   ///< [0, 1] of HSV; what is greyer is no colour at all
  double min_value = 0.1;         ///< [0, 1] of HSV; what is darker is shadow
};

/// One connected patch of a colour.
struct Blob {
  double weight_px = 0;         ///< its area, where a pixel covered by half counts half
  Eigen::Vector2d centroid_px;  ///< weighted; pixel centres at integer + 0.5, as in Camera
  cv::Mat cover;                ///< CV_32F, image-sized, in [0, 1]: how much of a pixel belongs to it
};

/// How much of each pixel is of this colour, CV_32F in [0, 1]. Saturation is measured against the most saturated pixels
/// of that hue in the picture: a pixel half on a grey ground counts about half, and shade changes little.
/// @param rgb  CV_8UC3, RGB.
cv::Mat Cover(const cv::Mat& rgb, const ColourModel& colour);

/// The connected patches of a colour, the largest first; those below `min_weight_px` are noise and left out.
std::vector<Blob> FindBlobs(const cv::Mat& rgb, const ColourModel& colour, double min_weight_px);

/// Where the ray through a pixel meets the horizontal plane at `height_m` (base frame), or nothing if it does not.
std::optional<Eigen::Vector3d> OnPlane(const Camera& camera, const Eigen::Isometry3d& base_from_camera,
                                       const Eigen::Vector2d& pixel, double height_m);

}  // namespace evac
