#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/seed.h"
#include "tests/nn/support.h"
#include "worldmodel/imaginer.h"

namespace evac {

/// Two views of a small network of hashed weights.
inline nn::ModelConfig SmallConfig(std::int64_t views = 2) {
  nn::ModelConfig config = nn::TinyConfig();
  config.views = views;
  return config;
}

inline std::unique_ptr<const nn::EvacModel> SmallModel(const nn::ModelConfig& config) {
  nn::HashWeights weights;
  return std::make_unique<const nn::EvacModel>(weights, config);
}

/// Quick, and every kind of noise is used.
inline ImaginerOptions FewSteps() {
  ImaginerOptions options;
  options.sampler.steps = 2;
  options.conditioning.pose_map = PoseMapOptions::ForHeight(16);
  return options;
}

inline Imaginer SmallImaginer(std::int64_t views = 2, const ImaginerOptions& options = FewSteps()) {
  return Imaginer(SmallModel(SmallConfig(views)), options);
}

inline cv::Mat Picture(int width_px, int height_px, std::uint64_t seed) {
  cv::Mat picture(height_px, width_px, CV_8UC3);
  SplitMix64 random(seed);
  for (int y = 0; y < height_px; ++y)
    for (int x = 0; x < width_px; ++x)
      for (int c = 0; c < 3; ++c) picture.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>(random.Below(256));
  return picture;
}

/// One metre in front of the base, looking down at it from above.
inline Camera CameraNamed(const std::string& name, Mount mount = Mount::kBase) {
  Camera camera{.name = name, .width_px = 48, .height_px = 36, .fx_px = 40, .fy_px = 41, .cx_px = 24, .cy_px = 18};
  camera.mount = mount;
  camera.mount_from_camera.linear() = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitX()).toRotationMatrix();
  camera.mount_from_camera.translation() = Eigen::Vector3d(0.4, 0, mount == Mount::kBase ? 1.2 : 0.2);
  return camera;
}

/// A base camera, and as many on the right gripper as are left.
inline std::vector<Camera> SomeCameras(std::size_t views) {
  std::vector<Camera> cameras = {CameraNamed("head")};
  while (cameras.size() < views) cameras.push_back(CameraNamed("hand_right", Mount::kRightGripper));
  return cameras;
}

inline Arms ArmsAt(double x_m, std::size_t count = 1) {
  ArmState arm;
  arm.base_from_gripper.translation() = Eigen::Vector3d(x_m, 0.1, 0.3);
  arm.base_from_gripper.linear() = Eigen::AngleAxisd(3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  arm.closure = 0.4;
  return Arms(count, arm);
}

/// `count` targets, each 1 cm further.
inline std::vector<Arms> Targets(std::size_t count, double from_m = 0.4) {
  std::vector<Arms> targets;
  for (std::size_t k = 1; k <= count; ++k) targets.push_back(ArmsAt(from_m + 0.01 * static_cast<double>(k)));
  return targets;
}

inline InitialScene SomeScene(std::uint64_t seed, std::size_t views = 2) {
  InitialScene scene{.images = {}, .arms = ArmsAt(0.4), .cameras = SomeCameras(views)};
  for (std::size_t v = 0; v < views; ++v) scene.images.push_back(Picture(48, 36, seed + v));
  return scene;
}

}  // namespace evac
