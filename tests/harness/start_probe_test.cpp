#include "harness/start_probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace evac {
namespace {

using testing::HasSubstr;

Task TwoArms() {
  Task task;
  task.arms = {"left", "right"};
  task.period_s = 0.1;
  return task;
}

Arms At(double left_y_m, double right_y_m) {
  Arms arms(2);
  arms[0].base_from_gripper.translation() = Eigen::Vector3d(0.5, left_y_m, 0.3);
  arms[1].base_from_gripper.translation() = Eigen::Vector3d(0.5, right_y_m, 0.3);
  return arms;
}

TEST(StartProbe, AnHonestChunkRaisesNoSuspicion) {
  ActionChunk chunk;
  for (int k = 1; k <= 8; ++k) chunk.targets.push_back(At(0.3 + 0.03 * k, -0.3));
  EXPECT_TRUE(StartSuspicions(At(0.3, -0.3), chunk, TwoArms()).empty());
}

TEST(StartProbe, SwappedArmsAreSeenOnBoth) {
  const ActionChunk chunk{.targets = {At(-0.3, 0.3)}};
  const auto found = StartSuspicions(At(0.3, -0.3), chunk, TwoArms());
  ASSERT_EQ(found.size(), 2u);
  EXPECT_THAT(found[0].sentence,
              testing::AllOf(HasSubstr("left arm"), HasSubstr("0.6 m"), HasSubstr("are the arms swapped?")));
  EXPECT_TRUE(found[0].is_certain);
}

TEST(StartProbe, OneArmThatHasGoneFarIsAnotherFrame) {
  const ActionChunk chunk{.targets = {At(0.3, -0.9)}};
  const auto found = StartSuspicions(At(0.3, -0.3), chunk, TwoArms());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_THAT(found[0].sentence, testing::AllOf(HasSubstr("right arm"), HasSubstr("another frame")));
}

TEST(StartProbe, ASuddenClosureIsOnlyUnusual) {
  ActionChunk chunk{.targets = {At(0.3, -0.3)}};
  chunk.targets[0][1].closure = 1;
  const auto found = StartSuspicions(At(0.3, -0.3), chunk, TwoArms());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].is_certain);
}

TEST(StartProbe, TargetsForAnotherPeriodAreTooFast) {
  ActionChunk chunk;
  for (int k = 1; k <= 3; ++k) chunk.targets.push_back(At(0.3, -0.3 - 0.31 * (k - 1)));
  const auto found = StartSuspicions(At(0.3, -0.3), chunk, TwoArms());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_THAT(found[0].sentence, HasSubstr("3.1 m/s at a period of 0.1 s"));
}

TEST(StartProbe, AMalformedChunkIsLeftToItsEpisode) {
  const ActionChunk chunk{.targets = {Arms(1)}};
  EXPECT_TRUE(StartSuspicions(At(0.3, -0.3), chunk, TwoArms()).empty());
}

}  // namespace
}  // namespace evac
