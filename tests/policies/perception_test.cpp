#include "policies/perception.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "core/geometry.h"
#include "core/seed.h"
#include "policies/visual_motion.h"
#include "policies/visual_shape.h"

namespace evac {
namespace {

const ColourModel kGreen{.hue_deg = 140, .hue_tolerance_deg = 30};

Camera LookingCamera() {
  Camera camera{.name = "head", .width_px = 96, .height_px = 64, .fx_px = 98, .fy_px = 98, .cx_px = 48, .cy_px = 32};
  const Eigen::Vector3d at(1.1, -0.16, 0.58), forward = (Eigen::Vector3d(0.43, 0, 0.07) - at).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  camera.mount_from_camera.linear() << right, forward.cross(right), forward;
  camera.mount_from_camera.translation() = at;
  return camera;
}

/// A picture of `cover` in a colour on a ground, in some light, with what a sensor or a model that draws pictures does
/// to it.
cv::Mat Painted(const cv::Mat& cover, const cv::Scalar& colour, double light, double blur_px, double noise) {
  cv::Mat rgb(cover.size(), CV_32FC3);
  const cv::Scalar ground(200, 197, 192);
  for (int v = 0; v < rgb.rows; ++v) {
    for (int u = 0; u < rgb.cols; ++u) {
      const double share = cover.at<float>(v, u);
      for (int c = 0; c < 3; ++c)
        rgb.at<cv::Vec3f>(v, u)[c] = static_cast<float>(light * (share * colour[c] + (1 - share) * ground[c]));
    }
  }
  if (blur_px > 0) cv::GaussianBlur(rgb, rgb, {0, 0}, blur_px);
  SplitMix64 random(5);
  for (cv::Vec3f& pixel : cv::Mat3f(rgb)) {
    for (int c = 0; c < 3; ++c) pixel[c] += static_cast<float>(noise * random.Normal());
  }
  cv::Mat bytes;
  rgb.convertTo(bytes, CV_8UC3);
  return bytes;
}

TEST(Perception, APatchIsFoundToAFractionOfAPixelInAnyLight) {
  const Shape disc = {Frustum(0, 0.03, 0.001, 0.03)};
  const Camera camera = LookingCamera();
  const Eigen::Isometry3d base_from_disc = BaseFromObject({{0.443, -0.117}, 0}, 0.1);
  const cv::Mat cover = Silhouette(disc, camera, camera.mount_from_camera.inverse() * base_from_disc);
  const Eigen::Vector2d centre_px = *Project(camera, camera.mount_from_camera.inverse() * base_from_disc.translation());
  for (const double light : {0.5, 0.8, 1.1}) {
    const std::vector<Blob> blobs = FindBlobs(Painted(cover, {20, 150, 70}, light, 0.6, 2), kGreen, 4);
    ASSERT_EQ(blobs.size(), 1u) << "light " << light;
    EXPECT_LT((blobs[0].centroid_px - centre_px).norm(), 0.25) << "light " << light;
    EXPECT_NEAR(blobs[0].weight_px, cv::sum(cover)[0], 0.25 * cv::sum(cover)[0]) << "light " << light;
  }
}

TEST(Perception, WhatIsGreyOrOfAnotherHueIsNotTheColour) {
  cv::Mat1f cover(64, 96, 0.f);
  cv::rectangle(cover, {40, 20, 12, 12}, 1, cv::FILLED);
  for (const cv::Scalar& other :
       {cv::Scalar(90, 90, 90), cv::Scalar(115, 65, 150), cv::Scalar(128, 84, 43), cv::Scalar(240, 240, 240)}) {
    EXPECT_TRUE(FindBlobs(Painted(cover, other, 1, 0, 2), kGreen, 4).empty()) << other;
  }
}

TEST(Perception, TheRayThroughAProjectedPointMeetsItsPlaneThere) {
  const Camera camera = LookingCamera();
  const Eigen::Vector3d point_m(0.41, 0.09, 0.12);
  const Eigen::Vector2d pixel = *Project(camera, camera.mount_from_camera.inverse() * point_m);
  EXPECT_LT((*OnPlane(camera, camera.mount_from_camera, pixel, point_m.z()) - point_m).norm(), 1e-9);
  EXPECT_FALSE(OnPlane(camera, camera.mount_from_camera, pixel, 0.7)) << "a plane above a camera that looks down";
}

TEST(Perception, AShapeIsFoundWhereItWasDrawnThroughBlurAndNoise) {
  const Shape slice = {Cuboid({-0.007, -0.035, 0.04}, {0.007, 0.035, 0.08})};
  const Camera camera = LookingCamera();
  SplitMix64 random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const Placement truth{{random.Uniform(0.38, 0.5), random.Uniform(-0.2, 0.18)}, 0.1};
    const Eigen::Isometry3d camera_from_slice = camera.mount_from_camera.inverse() * BaseFromObject(truth, 0);
    const cv::Mat rgb = Painted(Silhouette(slice, camera, camera_from_slice), {30, 150, 70}, 0.9, 0.7, 3);
    const ShapeFit start{{truth.xy_m + Eigen::Vector2d(0.015, -0.01), truth.yaw_rad}, 0};
    const ShapeFit fit = FitShape(Cover(rgb, kGreen), slice, camera, camera.mount_from_camera, start, {});
    EXPECT_LT((fit.placement.xy_m - truth.xy_m).norm(), 0.005) << "trial " << trial;
    EXPECT_GT(fit.overlap, 0.5);
  }
}

TEST(Perception, ASilhouetteBehindTheCameraIsEmpty) {
  const Camera camera = LookingCamera();
  const Eigen::Isometry3d behind = camera.mount_from_camera.inverse() * BaseFromObject({{2, 0}, 0}, 0.6);
  EXPECT_EQ(cv::countNonZero(Silhouette({Cuboid({0, 0, 0}, {0.1, 0.1, 0.1})}, camera, behind)), 0);
}

TEST(Timeline, NeverExceedsItsSpeedAndEndsWhereItWasSent) {
  const SpeedLimits limits;
  Timeline path(Eigen::Isometry3d::Identity(), limits);
  Eigen::Isometry3d goal(Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitX()));
  goal.translation() << 0.2, -0.1, 0.3;
  path.MoveTo(goal);
  path.Pause(0.3);
  path.MoveTo(Eigen::Isometry3d::Identity());
  const double step_s = 0.01;
  for (double time_s = 0; time_s < path.duration_s(); time_s += step_s) {
    const Eigen::Isometry3d now = path.At(time_s), next = path.At(time_s + step_s);
    EXPECT_LE((next.translation() - now.translation()).norm(), 1.001 * limits.translation_mps * step_s);
    EXPECT_LE(RotationBetween(now, next), 1.001 * limits.rotation_radps * step_s);
  }
  EXPECT_TRUE(path.At(path.duration_s()).isApprox(Eigen::Isometry3d::Identity(), 1e-9));
  EXPECT_TRUE(path.At((path.duration_s()) / 2).isApprox(goal, 1e-9)) << "during the pause";
}

TEST(HandSchedule, ClosesOnceAndOpensOnce) {
  const HandSchedule hand{.start_closure = 0, .close_s = 1.0, .open_s = 2.0};
  EXPECT_EQ(hand.At(0.9), 0);
  EXPECT_EQ(hand.At(1.5), 1);
  EXPECT_EQ(hand.At(2.5), 0);
  const HandSchedule opens_first{.start_closure = 0, .close_s = 2.0, .open_s = 1.0};
  for (double time_s = 0; time_s < 4; time_s += 0.1)
    EXPECT_EQ(opens_first.At(time_s), 0) << "told to open, it never closes again";
}

}  // namespace
}  // namespace evac
