#include "worldmodel/sim/sensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "core/seed.h"

namespace evac::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Eigen::Vector3d NormalVector(SplitMix64& random, double deviation) {
  const double x = random.Normal(), y = random.Normal(), z = random.Normal();
  return deviation * Eigen::Vector3d(x, y, z);
}

Eigen::Matrix3d SmallRotation(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

}  // namespace

HiddenErrors DrawHiddenErrors(const Profile& profile, const Task& task) {
  const Profile::Calibration& calibration = profile.calibration;
  const std::uint64_t seed = SeedFor(static_cast<std::uint64_t>(calibration.seed), "calibration of " + profile.name);
  HiddenErrors errors;
  for (const std::string& arm : task.arms) {
    SplitMix64 random(SeedFor(seed, arm == "left" ? "joints of the left arm" : "joints"));
    Joints& offsets = errors.joint_offset.emplace_back();
    for (double& offset : offsets) offset = calibration.joint_offset_deg * kDegree * random.Normal();
  }
  for (const Camera& camera : task.cameras) {
    SplitMix64 of_camera(SeedFor(seed, "camera " + camera.name));
    Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
    error.translation() = NormalVector(of_camera, calibration.camera_position_m);
    error.linear() = SmallRotation(NormalVector(of_camera, calibration.camera_rotation_deg * kDegree));
    errors.camera_from_true_camera.push_back(error);
  }
  return errors;
}

void AddNoise(cv::Mat& image, double deviation_grey, std::uint64_t seed) {
  if (deviation_grey <= 0) return;
  // The number of ones among 64 random bits has mean 32 and deviation 4: one draw per value, the same bits on every
  // machine.
  SplitMix64 random(seed);
  std::transform(image.datastart, image.dataend, image.data, [&](std::uint8_t value) {
    const double noise = deviation_grey * (std::popcount(random.Next()) - 32) / 4.0;
    return static_cast<std::uint8_t>(std::clamp(std::floor(value + noise + 0.5), 0.0, 255.0));
  });
}

void AddNoise(ArmState& arm, const Profile::Sensors& sensors, std::uint64_t seed) {
  SplitMix64 random(seed);
  arm.base_from_gripper.translation() += NormalVector(random, sensors.arm_position_m);
  arm.base_from_gripper.linear() *= SmallRotation(NormalVector(random, sensors.arm_rotation_deg * kDegree));
  arm.closure = std::clamp(arm.closure + sensors.closure * random.Normal(), 0.0, 1.0);
}

}  // namespace evac::sim
