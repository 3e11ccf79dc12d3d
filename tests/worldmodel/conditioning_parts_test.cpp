#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/core.hpp>

#include "core/error.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/frame_memory.h"
#include "worldmodel/pose_map.h"
#include "worldmodel/ray_map.h"
#include "worldmodel/shard_writer.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

constexpr double kPi = std::numbers::pi;

GripperPose PoseAt(const Eigen::Vector3d& xyz_m, const Eigen::Quaterniond& rotation) { return {xyz_m, rotation, 0.5}; }

Eigen::Isometry3d BaseFromCamera() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(0.4, -0.1, 0.2);
  pose.linear() = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  return pose;
}

PoseMapView ViewOf(const Eigen::Isometry3d& base_from_camera) {
  PoseMapView view;
  view.camera_from_base = base_from_camera.inverse().matrix().cast<float>();
  view.intrinsics << 300, 0, 256, 0, 310, 160, 0, 0, 1;
  return view;
}

bool IsDrawn(const cv::Mat& map) {
  cv::Mat drawn = map != cv::Scalar::all(50);
  return cv::countNonZero(drawn.reshape(1)) > 0;
}

TEST(PoseMap, TheDiscIsWhereAnIndependentProjectionPutsTheFingers) {
  const Eigen::Isometry3d base_from_camera = BaseFromCamera();
  const Eigen::Vector3d fingers = base_from_camera * Eigen::Vector3d(0.15, -0.1, 1.2);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -0.5).normalized()));
  const GripperPose pose = PoseAt(fingers - rotation * Eigen::Vector3d(0, 0, 0.23), rotation);
  const DrawnGripper gripper = Drawn(Side::kRight, pose);
  PoseMapOptions options;
  options.radius_px = 6;
  const cv::Mat map = DrawPoseMap(std::span(&gripper, 1), ViewOf(base_from_camera), options);
  const int u = static_cast<int>(300 * 0.15 / 1.2 + 256), v = static_cast<int>(310 * -0.1 / 1.2 + 160);
  cv::Mat drawn;
  cv::inRange(map, cv::Scalar::all(50), cv::Scalar::all(50), drawn);
  EXPECT_EQ(drawn.at<std::uint8_t>(v, u), 0) << "the tool's origin is drawn over";
  EXPECT_GT(cv::countNonZero(drawn), 320 * 512 / 2) << "and most of the picture is not";
}

TEST(PoseMap, AxesPointWhereAnIndependentProjectionPutsTheirEnds) {
  const Eigen::Isometry3d base_from_camera = BaseFromCamera();
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(base_from_camera.linear());  // axes as the camera's
  const Eigen::Vector3d fingers = base_from_camera * Eigen::Vector3d(0, 0, 1);
  const GripperPose pose = PoseAt(fingers - rotation * Eigen::Vector3d(0, 0, 0.23), rotation);
  const DrawnGripper gripper = Drawn(Side::kRight, pose);
  PoseMapOptions options;
  options.radius_px = 1;
  options.thickness_px = 3;
  const cv::Mat map = DrawPoseMap(std::span(&gripper, 1), ViewOf(base_from_camera), options);
  const double turn = 0.5236;  // the right hand is drawn turned about its tool axis
  const cv::Point half_x(static_cast<int>(256 + 15 * std::cos(turn)), static_cast<int>(160 + 15.5 * std::sin(turn)));
  const cv::Point half_y(static_cast<int>(256 - 15 * std::sin(turn)), static_cast<int>(160 + 15.5 * std::cos(turn)));
  EXPECT_EQ(map.at<cv::Vec3b>(half_x), cv::Vec3b(255, 0, 255));
  EXPECT_EQ(map.at<cv::Vec3b>(half_y), cv::Vec3b(255, 0, 0));
}

TEST(PoseMap, ALineGoesStraightDownToWhatAnIndependentProjectionSaysOfTheTable) {
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();  // at 1 m, looking down along the table
  base_from_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  base_from_camera.translation() = Eigen::Vector3d(0, 0, 1);
  const Eigen::Vector3d fingers(1.2, 0.1, 0.9);
  const DrawnGripper gripper =
      Drawn(Side::kRight, PoseAt(fingers - Eigen::Vector3d(0, 0, 0.23), Eigen::Quaterniond::Identity()));
  PoseMapOptions options;
  options.radius_px = 1;
  options.thickness_px = 3;
  const PoseMapView view = ViewOf(base_from_camera);
  const cv::Mat without = DrawPoseMap(std::span(&gripper, 1), view, options);
  options.drop_line_m = 0.6;
  const cv::Mat with = DrawPoseMap(std::span(&gripper, 1), view, options);
  const Eigen::Vector3d foot = base_from_camera.inverse() * Eigen::Vector3d(1.2, 0.1, 0.6);
  const Eigen::Vector3f pixel = view.intrinsics * foot.cast<float>();
  const cv::Point at(static_cast<int>(pixel.x() / pixel.z()), static_cast<int>(pixel.y() / pixel.z()));
  EXPECT_EQ(with.at<cv::Vec3b>(at), cv::Vec3b(255, 160, 0));
  EXPECT_EQ(without.at<cv::Vec3b>(at), cv::Vec3b(50, 50, 50));
}

TEST(PoseMap, AGripperBehindTheCameraIsDrawnOnlyWithTheQuirkDrawBehindCamera) {
  const DrawnGripper gripper = Drawn(Side::kLeft, PoseAt({0, 0, -1.23}, Eigen::Quaterniond::Identity()));
  PoseMapView view = ViewOf(Eigen::Isometry3d::Identity());
  EXPECT_FALSE(IsDrawn(DrawPoseMap(std::span(&gripper, 1), view, {})));
  PoseMapOptions quirk;
  quirk.draw_behind_camera = true;
  EXPECT_TRUE(IsDrawn(DrawPoseMap(std::span(&gripper, 1), view, quirk)));
}

TEST(PoseMap, AnAxisThatEndsInTheCameraPlaneNeitherThrowsNorVanishes) {
  for (const double z : {-0.13, -0.23, -0.33, -0.2299999, 0.1, 1e30}) {
    const DrawnGripper gripper =
        Drawn(Side::kLeft, PoseAt({0, 0, z}, Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitX()))));
    for (const bool behind : {false, true}) {
      PoseMapOptions options;
      options.draw_behind_camera = behind;
      EXPECT_NO_THROW(DrawPoseMap(std::span(&gripper, 1), ViewOf(Eigen::Isometry3d::Identity()), options)) << z;
    }
  }
}

TEST(PoseMap, NumbersThatAreNoneDrawNothing) {
  DrawnGripper gripper;
  gripper.xyz_m = Eigen::Vector3f(std::nanf(""), 0, 1);
  EXPECT_FALSE(IsDrawn(DrawPoseMap(std::span(&gripper, 1), ViewOf(Eigen::Isometry3d::Identity()), {})));
}

TEST(PoseMap, SizesGrowWithThePictureOnlyWhenAsked) {
  EXPECT_EQ(PoseMapOptions{}.radius_px, 50);
  EXPECT_EQ(PoseMapOptions::ForHeight(320).radius_px, 50);
  EXPECT_EQ(PoseMapOptions::ForHeight(64).radius_px, 10);
  EXPECT_EQ(PoseMapOptions::ForHeight(64).thickness_px, 2);
}

/// Shards have the one, a training and a world the other.
TEST(PoseMap, AreSaidAlikeByThePageAndByWhatIsDrawn) {
  const auto words = [](const nn::ModelConfig& config) {
    EXPECT_EQ(PoseMapWords(PoseMapOptions::Of(config)), config.pose_map.Words(config.image_height_px));
    return config.pose_map.Words(config.image_height_px);
  };
  nn::ModelConfig config;
  EXPECT_EQ(words(config), "radius_px=50 thickness_px=8");
  config.pose_map.scaled = true;
  EXPECT_EQ(words(config), "radius_px=50 thickness_px=8") << "of the published height";
  config.image_height_px = 96;
  EXPECT_EQ(words(config), "radius_px=15 thickness_px=2");
  config.pose_map.scaled = false;
  config.pose_map.tool_length_m = 0.1;
  EXPECT_EQ(words(config), "radius_px=50 thickness_px=8 tool_length_m=0.1");
  EXPECT_EQ(words(ReadEvacConfig(EVAC_SOURCE_DIR "/apps/configs/desk_model.yaml")),
            "radius_px=10 thickness_px=2 drop_line_m=0 tool_length_m=0 lag_frames=0.5");
}

TEST(RayMap, EachRayIsTheOneThatAnIndependentProjectionSendsBack) {
  const Eigen::Isometry3d base_from_camera = BaseFromCamera();
  Eigen::Matrix3f intrinsics;
  intrinsics << 30, 0, 32, 0, 31, 20, 0, 0, 1;
  const RayMap rays = MakeRayMap(intrinsics, base_from_camera.matrix().cast<float>(), 40, 64);
  EXPECT_TRUE(rays.origin.cast<double>().isApprox(base_from_camera.translation(), 1e-6));
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(63, 39), std::pair(17, 30)}) {
    Eigen::Vector3d direction;
    for (int axis = 0; axis < 3; ++axis)
      direction[axis] = rays.direction[static_cast<std::size_t>((axis * 40 + y) * 64 + x)];
    EXPECT_NEAR(direction.norm(), 1, 1e-6);
    const Eigen::Vector3d in_camera = base_from_camera.inverse() * (base_from_camera.translation() + 2 * direction);
    EXPECT_NEAR(30 * in_camera.x() / in_camera.z() + 32, x + 0.5, 1e-4);
    EXPECT_NEAR(31 * in_camera.y() / in_camera.z() + 20, y + 0.5, 1e-4);
  }
}

TEST(ActionDelta, AnglesGoTheShortWayRound) {
  const auto yawed = [](double yaw) {
    return PoseAt(Eigen::Vector3d::Zero(), Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())));
  };
  const ActionDelta delta = DeltaBetween({yawed(3.1), yawed(0)}, {yawed(-3.1), yawed(0.2)});
  EXPECT_NEAR(delta[5], 2 * kPi - 6.2, 1e-12);
  EXPECT_NEAR(delta[12], 0.2, 1e-12);
  EXPECT_EQ(delta[6], 0.5) << "the closure is absolute";
}

TEST(ActionDelta, RollPitchYawRebuildTheRotationAlsoAtGimbalLock) {
  for (const Eigen::Vector3d& angles :
       {Eigen::Vector3d(0.3, -0.7, 2.5), Eigen::Vector3d(-3, 1.5, -3), Eigen::Vector3d(0.4, kPi / 2, 0)}) {
    const auto rebuilt = [](const Eigen::Vector3d& rpy) {
      return Eigen::Quaterniond(Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX()));
    };
    EXPECT_LT(rebuilt(RollPitchYaw(rebuilt(angles))).angularDistance(rebuilt(angles)), 1e-6);
  }
}

TEST(ActionStatistics, TheAgiBotPageHoldsTheBuiltInNumbers) {
  const ActionStatistics page =
      ReadActionStatistics(std::filesystem::path(EVAC_SOURCE_DIR) / "apps/configs/robots/agibotworld.yaml");
  EXPECT_EQ(page.robot, AgiBotWorldStatistics().robot);
  EXPECT_EQ(page.mean, AgiBotWorldStatistics().mean);
  EXPECT_EQ(page.deviation, AgiBotWorldStatistics().deviation);
}

TEST(SparseMemory, IsTheFirstOthersEvenlySpacedAndTheNewest) {
  EXPECT_THAT(SparseMemory(20, 4), ElementsAre(0, 6, 13, 19));
  EXPECT_THAT(SparseMemory(7, 2), ElementsAre(0, 6));
  EXPECT_THAT(SparseMemory(9, 1), ElementsAre(8));
  EXPECT_THAT(SparseMemory(1, 3), ElementsAre(0, 0, 0));
  EXPECT_THROW(SparseMemory(0, 3), Error);
}

TEST(ChunkPlan, EveryDeltaIsUsedOnceInItsOwnChunk) {
  const ChunkPlanOptions options{4, 4, false};
  ASSERT_EQ(ChunkCount(18, options), 4u);
  std::size_t next = 0;
  for (std::size_t index = 0; index < 4; ++index) {
    const ChunkPlan plan = PlanChunk(18, index, options);
    EXPECT_THAT(plan.rows, SizeIs(8));
    EXPECT_THAT(plan.deltas, SizeIs(4));
    for (const auto& delta : plan.deltas) {
      if (!delta) continue;
      EXPECT_EQ(*delta, next++);
    }
  }
  EXPECT_EQ(next, 14u);
}

TEST(ChunkPlan, DeltasComeLateAndOneTooManyOnlyWithTheQuirkDeltaWindow) {
  const ChunkPlan quirk = PlanChunk(18, 1, {4, 4, true});
  EXPECT_THAT(quirk.deltas, ElementsAre(7, 8, 9, 10, 11));
  EXPECT_THAT(PlanChunk(18, 1, {4, 4, false}).deltas, ElementsAre(4, 5, 6, 7));
  EXPECT_THAT(PlanChunk(18, 2, {4, 4, true}).deltas, SizeIs(3)) << "rows suffice, deltas do not: nothing is filled up";
  EXPECT_THAT(PlanChunk(18, 3, {4, 4, true}).deltas,
              ElementsAre(std::nullopt, std::nullopt, std::nullopt, std::nullopt));
}

}  // namespace
}  // namespace evac
