#include "core/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Task OneArm() {
  Task task;
  task.cameras = {{"head", 24, 16, 20, 20, 12, 8, Mount::kBase, Eigen::Isometry3d::Identity()}};
  task.workspace_m = {Eigen::Vector3d(-1, -1, 0), Eigen::Vector3d(1, 1, 1)};
  return task;
}

ActionChunk Chunk(int count) {
  ActionChunk chunk;
  for (int k = 0; k < count; ++k) {
    ArmState arm;
    arm.base_from_gripper.translation() = Eigen::Vector3d(0.1 * k, 0, 0.5);
    arm.base_from_gripper.linear() = Eigen::AngleAxisd(k, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    chunk.targets.push_back({arm});
  }
  return chunk;
}

Observation Seen() { return {{cv::Mat(16, 24, CV_8UC3, cv::Scalar::all(0))}, Chunk(1).targets[0], false}; }

TEST(Check, AGoodChunkHasNothingWrong) {
  EXPECT_EQ(WhatIsWrong(Chunk(1), OneArm(), 8), std::nullopt);
  EXPECT_EQ(WhatIsWrong(Chunk(8), OneArm(), 8), std::nullopt);
}

TEST(Check, AChunkHasOneToMaxTargets) {
  EXPECT_THAT(WhatIsWrong(Chunk(0), OneArm(), 8).value(), HasSubstr("0 targets"));
  EXPECT_THAT(WhatIsWrong(Chunk(9), OneArm(), 8).value(), AllOf(HasSubstr("9 targets"), HasSubstr("1 … 8")));
}

TEST(Check, WhatIsWrongWithOneTargetIsSaidWithItsNumberAndArm) {
  const std::pair<std::function<void(ArmState&)>, const char*> spoils[] = {
      {[](ArmState& arm) { arm.base_from_gripper.translation().y() = kNan; }, "not finite"},
      {[](ArmState& arm) { arm.base_from_gripper.linear()(1, 2) = kNan; }, "not finite"},
      {[](ArmState& arm) { arm.base_from_gripper.linear() *= 1.01; }, "no rotation"},
      {[](ArmState& arm) { arm.base_from_gripper.linear().setZero(); }, "no rotation"},
      {[](ArmState& arm) { arm.base_from_gripper.linear().col(0) *= -1; }, "no rotation"},  // a mirror
      {[](ArmState& arm) { arm.base_from_gripper.translation().z() = 1.5; }, "(0.300, 0.000, 1.500)"},
      {[](ArmState& arm) { arm.closure = 1.25; }, "1.25"},
      {[](ArmState& arm) { arm.closure = -0.5; }, "-0.5"},
      {[](ArmState& arm) { arm.closure = kNan; }, "closure"},
  };
  for (const auto& [spoil, sentence] : spoils) {
    ActionChunk chunk = Chunk(8);
    spoil(chunk.targets[3][0]);
    EXPECT_THAT(WhatIsWrong(chunk, OneArm(), 8).value_or("nothing"),
                AllOf(HasSubstr("target 3 of 8"), HasSubstr("right arm"), HasSubstr(sentence)));
  }
}

TEST(Check, EveryTargetMovesTheTasksArms) {
  ActionChunk chunk = Chunk(3);
  chunk.targets[2].push_back(chunk.targets[2][0]);
  EXPECT_THAT(WhatIsWrong(chunk, OneArm(), 8).value(), AllOf(HasSubstr("2 arms"), HasSubstr("the task 1")));
  chunk.targets[2].clear();
  EXPECT_THAT(WhatIsWrong(chunk, OneArm(), 8).value(), HasSubstr("0 arms"));
}

TEST(Check, AnObservationHasTheCamerasImages) {
  EXPECT_EQ(WhatIsWrong(Seen(), OneArm()), std::nullopt);
  Observation none = Seen(), small = Seen(), grey = Seen();
  none.images.clear();
  small.images[0] = cv::Mat(15, 24, CV_8UC3);
  grey.images[0] = cv::Mat(16, 24, CV_8UC1);
  EXPECT_THAT(WhatIsWrong(none, OneArm()).value(), HasSubstr("0 images"));
  EXPECT_THAT(WhatIsWrong(small, OneArm()).value(), AllOf(HasSubstr("head"), HasSubstr("24x15"), HasSubstr("24x16")));
  EXPECT_THAT(WhatIsWrong(grey, OneArm()).value(), HasSubstr("1 channels"));
}

TEST(Check, AnObservedArmMayLeaveTheWorkspaceButNotTheNumbers) {
  Observation outside = Seen(), nowhere = Seen();
  outside.arms[0].base_from_gripper.translation().z() = 5;
  nowhere.arms[0].base_from_gripper.translation().z() = kNan;
  EXPECT_EQ(WhatIsWrong(outside, OneArm()), std::nullopt);
  EXPECT_THAT(WhatIsWrong(nowhere, OneArm()).value(), HasSubstr("not finite"));
}

}  // namespace
}  // namespace evac
