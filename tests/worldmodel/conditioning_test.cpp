#include "worldmodel/conditioning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/geometry.h"
#include "tests/worldmodel/imagined_support.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/nn/hand_turns.h"

namespace evac {
namespace {

using testing::Each;
using testing::SizeIs;

/// A scene of one frame, remembered twice: N = 2, K = 3, cameras on the base and on the right gripper.
ImaginedScene Started(std::size_t arms = 1) {
  ImaginedScene scene;
  for (const Camera& camera : SomeCameras(2)) scene.cameras.push_back(Resized(camera, 24, 16));
  scene.frames.assign(2, {{}, ArmsAt(0.4, arms)});
  return scene;
}

ChunkConditioning Told(const ImaginedScene& scene, const std::vector<Arms>& targets) {
  return Condition(scene, {0, 1}, targets, SmallConfig(), FewSteps().conditioning);
}

TEST(Conditioning, HasMapsOfTheFramesToImagineAndRaysOfAll) {
  const ChunkConditioning told = Told(Started(), Targets(3));
  EXPECT_THAT(told.deltas, SizeIs(3));
  EXPECT_THAT(told.pose_maps, SizeIs(3)) << "none of the memory";
  EXPECT_THAT(told.pose_maps, Each(SizeIs(2)));
  EXPECT_THAT(told.rays, SizeIs(2 + 3));
  EXPECT_THAT(told.rays, Each(SizeIs(2)));
  EXPECT_EQ(told.pose_maps[0][0].size(), cv::Size(24, 16));
  EXPECT_EQ(told.rays[0][0].height, 8);
}

TEST(Conditioning, AWristCamerasRaysMoveWithTheCommandedGripperAndABaseCamerasStay) {
  const ChunkConditioning told = Told(Started(), Targets(3));
  for (std::size_t t = 0; t < told.rays.size(); ++t) {
    EXPECT_EQ(told.rays[t][0].origin, told.rays[0][0].origin);
    const double moved_m = t < 2 ? 0 : 0.01 * static_cast<double>(t - 1);
    EXPECT_NEAR(told.rays[t][1].origin.x() - told.rays[0][1].origin.x(), moved_m, 1e-6) << t;
  }
}

TEST(Conditioning, ArmsThatFollowLateCarryTheirCamerasLateToo) {
  ImaginedScene scene = Started();
  scene.frames.push_back({{}, Targets(1).front()});  // executed: .01 m further
  ConditioningOptions options = FewSteps().conditioning;
  options.pose_map.lag_frames = 0.25;
  const ChunkConditioning told = Condition(scene, {0, 2}, Targets(3), SmallConfig(), options);
  const double at_rest_m = told.rays[0][1].origin.x();
  EXPECT_NEAR(told.rays[1][1].origin.x() - at_rest_m, 0.0075, 1e-6) << "a remembered frame, seen as it was seen";
  EXPECT_NEAR(told.rays[2][1].origin.x() - at_rest_m, 0.01, 1e-6) << "told the same twice: there by now";
  EXPECT_NEAR(told.rays[3][1].origin.x() - at_rest_m, 0.0175, 1e-6);
  const std::vector<Arms> far = {ArmsAt(0.6)};
  const ChunkConditioning late = Condition(scene, {0, 2}, far, SmallConfig(), options),
                          at_once = Condition(scene, {0, 2}, far, SmallConfig(), FewSteps().conditioning);
  EXPECT_EQ(late.deltas, at_once.deltas);
  EXPECT_EQ(late.arms, at_once.arms);
  EXPECT_NE(cv::norm(late.pose_maps[0][0], at_once.pose_maps[0][0], cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(late.pose_maps[1][0], at_once.pose_maps[1][0], cv::NORM_INF), 0) << "there by then";
}

TEST(Conditioning, WhereAHandClosedIsKnownAfterItsFrameIsForgotten) {
  ImaginedScene scene = Started();
  for (const double closure : {0.0, 1.0, 1.0, 1.0}) {
    Arms arms = scene.frames.back().arms;
    arms[0].base_from_gripper.translation().x() += 0.01;
    arms[0].closure = closure;
    scene.frames.push_back({{}, arms});
  }
  const double closed_at_m = scene.frames[3].arms[0].base_from_gripper.translation().x();
  const ChunkConditioning told = Condition(scene, {0, 5}, Targets(3), SmallConfig(), FewSteps().conditioning);
  ASSERT_EQ(told.turns.size(), 5 * nn::kTurnRow);
  const auto right_hand = [&](std::size_t frame, std::size_t kind, std::size_t number) {
    return told.turns[frame * nn::kTurnRow + (nn::kTurnKinds + kind) * nn::kTurnNumbers + number];
  };
  EXPECT_EQ(right_hand(0, 0, 0), 0) << "not closed at first";
  EXPECT_EQ(right_hand(1, 0, 1), 2) << "two frames ago, which memory leaves out";
  EXPECT_FLOAT_EQ(right_hand(1, 0, 2), static_cast<float>(closed_at_m));
  EXPECT_EQ(right_hand(2, 1, 0), 1) << "told .4 closed: open again";
  EXPECT_EQ(right_hand(4, 1, 1), 2);
  EXPECT_EQ(right_hand(4, 0, 1), 5) << "and yet it had closed";
}

TEST(Conditioning, ATurnIsSeenOnTheShortWay) {
  Arms before(1), now(1);
  before[0].base_from_gripper = Eigen::AngleAxisd(3.0, Eigen::Vector3d::UnitZ());
  now[0].base_from_gripper = Eigen::AngleAxisd(-3.0, Eigen::Vector3d::UnitZ());
  const Eigen::Isometry3d seen = SeenArms(before, now, 0.5)[0].base_from_gripper;
  EXPECT_NEAR(RotationBetween(seen, Eigen::Isometry3d(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()))), 0, 1e-6);
}

TEST(Conditioning, DeltasLeadFromEachFrameToTheNext) {
  const ChunkConditioning told = Told(Started(), Targets(3));
  const ActionStatistics statistics = AgiBotWorldStatistics();
  for (const DeltaRow& row : told.deltas) {
    EXPECT_NEAR(row[7], (0.01 - 3 * statistics.mean[6]) / (3 * statistics.deviation[6]), 1e-4) << "right x";
    EXPECT_FLOAT_EQ(row[13], 0.4F) << "the closure is absolute";
    EXPECT_NEAR(row[0], -statistics.mean[0] / statistics.deviation[0], 1e-6)
        << "there is no left arm: it does not move";
    EXPECT_EQ(row[6], 0) << "and is open";
  }
}

TEST(Conditioning, AfterTheLastTargetTheArmsRest) {
  const ChunkConditioning told = Told(Started(), Targets(1));
  EXPECT_EQ(told.count, 1u);
  const ActionStatistics statistics = AgiBotWorldStatistics();
  for (std::size_t k : {1, 2}) {
    EXPECT_NEAR(told.deltas[k][7], -statistics.mean[6] / statistics.deviation[6], 1e-6);
    EXPECT_FLOAT_EQ(told.deltas[k][13], 0.4F);
    EXPECT_EQ(cv::norm(told.pose_maps[k][0], told.pose_maps[0][0], cv::NORM_INF), 0);
    EXPECT_EQ(told.rays[2 + k][1].origin, told.rays[2][1].origin);
  }
}

bool HasColour(const cv::Mat& map, const cv::Scalar& colour) {
  cv::Mat found;
  cv::inRange(map, colour, colour, found);
  return cv::countNonZero(found) > 0;
}

TEST(Conditioning, OneArmIsDrawnAsTheRightOneAndTheOtherIsMissing) {
  const cv::Scalar left_y(255, 255, 0), right_y(255, 0, 0);
  PoseMapOptions options;
  options.radius_px = 2;
  options.thickness_px = 1;
  const std::vector<Camera> cameras = {CameraNamed("head")};
  const cv::Mat one = DrawPoseMaps(ArmsAt(0.4, 1), cameras, options)[0];
  EXPECT_TRUE(HasColour(one, right_y));
  EXPECT_FALSE(HasColour(one, left_y));
  Arms two = ArmsAt(0.4, 2);
  two[0].base_from_gripper.translation().y() += 0.15;
  const cv::Mat both = DrawPoseMaps(two, cameras, options)[0];
  EXPECT_TRUE(HasColour(both, right_y));
  EXPECT_TRUE(HasColour(both, left_y));
}

TEST(Conditioning, AChunkOfNoTargetsOrTooManyIsRefused) {
  EXPECT_THROW(Told(Started(), {}), Error);
  EXPECT_THROW(Told(Started(), Targets(4)), Error);
}

}  // namespace
}  // namespace evac
