#include "policies/perception.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/geometry.h"

namespace evac {
namespace {

constexpr double kReferencePercentile = 0.8;  // of the saturation of a hue's pixels: what counts as fully covered
constexpr double kTint = 0.6;     // of the minimal saturation: a background less tinted than this counts as grey
constexpr float kTouches = 0.2f;  // pixels covered less than this do not connect patches

double HueDistance(double a_deg, double b_deg) {
  const double distance = std::fmod(std::abs(a_deg - b_deg), 360.0);
  return std::min(distance, 360.0 - distance);
}

/// 1 within the tolerance, falling to 0 at 1.5 times it: noise at its edge must not make holes.
double HueMatch(double hue_deg, const ColourModel& colour) {
  const double beyond = HueDistance(hue_deg, colour.hue_deg) / colour.hue_tolerance_deg - 1.0;
  return std::clamp(1.0 - 2.0 * beyond, 0.0, 1.0);
}

bool IsOfColour(const cv::Vec3f& hsv, const ColourModel& colour) {
  return hsv[1] >= colour.min_saturation && hsv[2] >= colour.min_value &&
         HueDistance(hsv[0], colour.hue_deg) <= colour.hue_tolerance_deg;
}

/// The saturation of a fully covered pixel in this picture, or 0 if none has the colour.
double ReferenceSaturation(const cv::Mat3f& hsv, const ColourModel& colour) {
  std::vector<float> saturations;
  for (const cv::Vec3f& pixel : hsv) {
    if (IsOfColour(pixel, colour)) saturations.push_back(pixel[1]);
  }
  if (saturations.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(kReferencePercentile * (saturations.size() - 1));
  std::nth_element(saturations.begin(), saturations.begin() + rank, saturations.end());
  return saturations[rank];
}

cv::Mat3f ToHsv(const cv::Mat& rgb) {
  if (rgb.type() != CV_8UC3) throw InternalError("perception got an image of type {}, wanted 8 bit RGB", rgb.type());
  cv::Mat3f unit, hsv;
  rgb.convertTo(unit, CV_32FC3, 1.0 / 255);
  cv::cvtColor(unit, hsv, cv::COLOR_RGB2HSV);
  return hsv;
}

}  // namespace

cv::Mat Cover(const cv::Mat& rgb, const ColourModel& colour) {
  const cv::Mat3f hsv = ToHsv(rgb);
  const double full = ReferenceSaturation(hsv, colour);
  const double none = kTint * colour.min_saturation;
  cv::Mat1f cover(rgb.size(), 0.f);
  if (full <= none) return cover;
  for (int v = 0; v < rgb.rows; ++v) {
    for (int u = 0; u < rgb.cols; ++u) {
      const cv::Vec3f& pixel = hsv(v, u);
      if (pixel[2] < colour.min_value) continue;
      const double share = std::clamp((pixel[1] - none) / (full - none), 0.0, 1.0);
      cover(v, u) = static_cast<float>(HueMatch(pixel[0], colour) * share);
    }
  }
  return cover;
}

std::vector<Blob> FindBlobs(const cv::Mat& rgb, const ColourModel& colour, double min_weight_px) {
  const cv::Mat cover = Cover(rgb, colour);
  cv::Mat labels;
  const int count = cv::connectedComponents(cover > kTouches, labels, 8, CV_32S);
  std::vector<Blob> blobs;
  for (int label = 1; label < count; ++label) {
    Blob blob;
    cover.copyTo(blob.cover, labels == label);
    const cv::Moments m = cv::moments(blob.cover);
    if (m.m00 < min_weight_px) continue;
    blob.weight_px = m.m00;
    blob.centroid_px = {m.m10 / m.m00 + 0.5, m.m01 / m.m00 + 0.5};
    blobs.push_back(std::move(blob));
  }
  std::stable_sort(blobs.begin(), blobs.end(), [](const Blob& a, const Blob& b) { return a.weight_px > b.weight_px; });
  return blobs;
}

std::optional<Eigen::Vector3d> OnPlane(const Camera& camera, const Eigen::Isometry3d& base_from_camera,
                                       const Eigen::Vector2d& pixel, double height_m) {
  const Eigen::Vector3d origin = base_from_camera.translation();
  const Eigen::Vector3d direction = base_from_camera.linear() * Ray(camera, pixel);
  if (std::abs(direction.z()) < 1e-9) return std::nullopt;
  const double distance_m = (height_m - origin.z()) / direction.z();
  if (distance_m <= 0) return std::nullopt;
  return origin + distance_m * direction;
}

}  // namespace evac
