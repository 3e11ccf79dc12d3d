#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/check.h"
#include "core/error.h"
#include "tests/worldmodel/sim/scripted_pick.h"
#include "tests/worldmodel/sim/sim_test_support.h"

namespace evac::test {
namespace {

Task TwoArms() { return WithTinyPictures(ReadTask("take_bottle_two_arms")); }

TEST(TwoArms, AreObservedLeftThenRightWithThreeCameras) {
  sim::MujocoWorld world = MakeWorld("real");
  const Task task = TwoArms();
  const WorldStep first = world.Reset(0, task, State(1), 1);
  EXPECT_EQ(WhatIsWrong(first.observation, task), std::nullopt);
  ASSERT_EQ(first.observation.arms.size(), 2U);
  EXPECT_EQ(first.observation.images.size(), 3U);
  const auto off_m = [&](int arm, const char* body) {
    return (first.observation.arms[arm].base_from_gripper.translation() - PoseIn(first.privileged, body).translation())
        .norm();
  };
  EXPECT_LT(off_m(0, "left_gripper"), 0.01);
  EXPECT_LT(off_m(1, "gripper"), 0.01);
}

TEST(TwoArms, TheLeftHandHoldsTheBoxByItsTabFromTheBeginning) {
  sim::MujocoWorld world = MakeWorld("sim");
  for (std::uint64_t state = 0; state < 5; ++state) {
    const WorldStep first = world.Reset(0, TwoArms(), State(state), 1);
    EXPECT_GT(ForceIn(first.privileged, "box", "left_finger_left"), 1) << state;
    EXPECT_GT(ForceIn(first.privileged, "box", "left_finger_right"), 1) << state;
  }
}

TEST(TwoArms, EachGoesWhereItIsTold) {
  sim::MujocoWorld world = MakeWorld("sim");
  Arms goal = world.Reset(0, TwoArms(), State(1), 1).observation.arms;
  goal[0].closure = 0;
  goal[0].base_from_gripper.translation() += Eigen::Vector3d(-0.02, 0.10, 0.10);
  goal[1].base_from_gripper.translation() += Eigen::Vector3d(0.02, -0.10, 0.03);
  const Arms end = Advance(world, 0, std::vector<Arms>(25, goal)).back().observation.arms;
  for (int arm = 0; arm < 2; ++arm) {
    EXPECT_LT((end[arm].base_from_gripper.translation() - goal[arm].base_from_gripper.translation()).norm(), 0.002);
    EXPECT_LT(RotationBetween(end[arm].base_from_gripper, goal[arm].base_from_gripper), 0.01);
  }
}

TEST(TwoArms, TheLeftHandCarriesTheBoxByFrictionAlone) {
  sim::MujocoWorld world = MakeWorld("sim");
  const Task task = TwoArms();
  const WorldStep first = world.Reset(0, task, State(2), 1);
  Arms lifted = first.observation.arms;
  lifted[0].closure = 1;
  lifted[0].base_from_gripper.translation().z() += 0.10;
  const auto steps = Advance(world, 0, std::vector<Arms>(15, lifted));
  EXPECT_GT(PoseIn(steps.back().privileged, "box").translation().z(), 0.05);
}

TEST(TwoArms, ATaskAndASceneThatDisagreeAboutArmsAreRefused) {
  sim::MujocoWorld world = MakeWorld("sim");
  Task task = TwoArms();
  const auto complaint = [&] {
    try {
      world.Reset(0, task, State(1), 1);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no complaint");
  };
  task.page.replace(task.page.find("take_bottle_two_arms.xml"), 24, "take_bottle.xml");
  EXPECT_THAT(complaint(), testing::HasSubstr("[right]"));
  task = TwoArms();
  task.arms = {"right"};
  EXPECT_THAT(complaint(), testing::HasSubstr("left"));
}

}  // namespace
}  // namespace evac::test
