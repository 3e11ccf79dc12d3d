#include "core/geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Isometry3d SomePose(SplitMix64& random) {
  const Eigen::Vector4d quat(random.Normal(), random.Normal(), random.Normal(), random.Normal());
  return FromXyzQuat({random.Normal(), random.Normal(), random.Normal()}, quat);
}

Camera SomeCamera() { return {"head", 96, 64, 90, 85, 47.5, 33, Mount::kBase, Isometry3d::Identity()}; }

TEST(Geometry, APointOnTheRayOfAPixelIsSeenInThatPixel) {
  SplitMix64 random(1);
  for (int i = 0; i < 100; ++i) {
    const Vector2d pixel(random.Uniform(0, 96), random.Uniform(0, 64));
    const Vector3d ray = Ray(SomeCamera(), pixel);
    EXPECT_NEAR(ray.norm(), 1, 1e-12);
    const auto seen = Project(SomeCamera(), random.Uniform(0.1, 9) * ray);
    ASSERT_TRUE(seen);
    EXPECT_LT((*seen - pixel).norm(), 1e-9);
  }
}

TEST(Geometry, ThePrincipalPointLooksForwardRightIsRightAndDownIsDown) {
  EXPECT_EQ(Ray(SomeCamera(), {47.5, 33}), Vector3d::UnitZ());
  EXPECT_GT(Project(SomeCamera(), {0.1, 0, 1})->x(), 47.5);
  EXPECT_GT(Project(SomeCamera(), {0, 0.1, 1})->y(), 33);
}

TEST(Geometry, WhatIsBehindTheCameraIsNotSeen) {
  EXPECT_FALSE(Project(SomeCamera(), {0, 0, -1}));
  EXPECT_FALSE(Project(SomeCamera(), {0, 0, 0}));
}

TEST(Geometry, AResizedCameraSeesTheSameRayAtTheScaledPixel) {
  const Camera half = Resized(SomeCamera(), 48, 16);
  EXPECT_EQ(half.width_px, 48);
  EXPECT_EQ(half.height_px, 16);
  EXPECT_LT((Ray(half, {10, 5}) - Ray(SomeCamera(), {20, 20})).norm(), 1e-12);
}

TEST(Geometry, ACameraStandsOnItsMount) {
  SplitMix64 random(2);
  const Arms arms = {{SomePose(random), 0}, {SomePose(random), 1}};
  Camera camera = SomeCamera();
  camera.mount_from_camera = SomePose(random);
  EXPECT_TRUE(BaseFromCamera(camera, {}).isApprox(camera.mount_from_camera));
  camera.mount = Mount::kLeftGripper;
  EXPECT_TRUE(BaseFromCamera(camera, arms).isApprox(arms[0].base_from_gripper * camera.mount_from_camera));
  camera.mount = Mount::kRightGripper;
  EXPECT_TRUE(BaseFromCamera(camera, arms).isApprox(arms[1].base_from_gripper * camera.mount_from_camera));
  EXPECT_TRUE(BaseFromCamera(camera, {arms[0]}).isApprox(arms[0].base_from_gripper * camera.mount_from_camera));
  EXPECT_THROW(BaseFromCamera(camera, {}), Error);
}

TEST(Geometry, ACameraOnALeftGripperThatIsNotThereIsRefusedAndNotCarriedByTheRight) {
  Camera camera = SomeCamera();
  camera.mount = Mount::kLeftGripper;
  const Arms right_alone(1);
  EXPECT_THAT([&] { BaseFromCamera(camera, right_alone); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("camera head is mounted on the left gripper")));
}

TEST(Geometry, AQuaternionIsReadInTheOrderXyzwAndNormalised) {
  const double half = std::numbers::pi / 8;
  const Isometry3d pose = FromXyzQuat({1, 2, 3}, 7 * Eigen::Vector4d(0, 0, std::sin(half), std::cos(half)));
  EXPECT_LT((pose * Vector3d(1, 0, 0) - Vector3d(1 + std::sqrt(0.5), 2 + std::sqrt(0.5), 3)).norm(), 1e-12);
}

TEST(Geometry, TheRotationBetweenTwoPosesIsTheAngleThatTurnsOneIntoTheOther) {
  SplitMix64 random(3);
  for (const double angle : {0.0, 1e-6, 0.3, 3.0, std::numbers::pi}) {
    const Isometry3d a = SomePose(random);
    Isometry3d b = a * Eigen::AngleAxisd(angle, Vector3d(1, -2, 0.5).normalized());
    b.translation() = Vector3d(9, 9, 9);
    EXPECT_NEAR(RotationBetween(a, b), angle, 1e-7);
    EXPECT_NEAR(RotationBetween(b, a), angle, 1e-7);
  }
}

TEST(Geometry, ACameraIsTheSameOneWithinAToleranceWhateverTheSizeOfItsPictures) {
  using testing::HasSubstr;
  const Camera known = SomeCamera();
  const auto differs = [&](const std::function<void(Camera&)>& change) {
    Camera asked = known;
    change(asked);
    return CalibrationDifference(known, asked, "in training");
  };
  EXPECT_EQ(differs([](Camera& camera) { camera = Resized(camera, 48, 96); }), "");
  EXPECT_EQ(differs([](Camera& camera) { camera.fx_px *= 1.04; }), "");
  EXPECT_THAT(differs([](Camera& camera) { camera.fx_px *= 1.06; }),
              HasSubstr("has a focal length of 0.994 picture widths, in training 0.938"));
  EXPECT_EQ(differs([](Camera& camera) { camera.mount_from_camera.translation().y() = 0.029; }), "");
  EXPECT_THAT(differs([](Camera& camera) { camera.mount_from_camera.translation().y() = -0.031; }),
              HasSubstr("stands 0.031 m and 0.0 degrees from where it stood in training"));
  const Eigen::AngleAxisd turn(0.1, Vector3d::UnitX());
  EXPECT_THAT(differs([&](Camera& camera) { camera.mount_from_camera.rotate(turn); }),
              HasSubstr("and 5.7 degrees from"));
  EXPECT_EQ(differs([](Camera& camera) { camera.mount = Mount::kRightGripper; }), "is mounted elsewhere");
}

}  // namespace
}  // namespace evac
