#include "harness/still.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Arms At(double x_m, double closure = 0) {
  ArmState arm;
  arm.base_from_gripper.translation() = Eigen::Vector3d(x_m, 0, 0);
  arm.closure = closure;
  return {arm};
}

std::vector<Arms> Stay(double x_m, double closure = 0) { return {At(x_m, closure), At(x_m, closure)}; }

constexpr StillRule kRule{.enabled = true, .translation_m = .005, .rotation_rad = .05, .closure = .05, .dwell_chunks = 2, .min_chunks = 3};

TEST(Still, AnEpisodeRestsAfterTheDwellAndNotBeforeTheMinimum) {
  StillMeter meter(kRule);
  EXPECT_FALSE(meter.Rest(At(0), Stay(0), Stay(0)));  // 0 executed
  EXPECT_FALSE(meter.Rest(At(0), Stay(0), Stay(0)));  // the dwell holds, but only 1 executed
  EXPECT_FALSE(meter.Rest(At(0), Stay(0), Stay(0)));
  EXPECT_TRUE(meter.Rest(At(0), Stay(0), Stay(0)));   // 3 executed
}

TEST(Still, MotionStartsTheDwellAgain) {
  StillMeter meter({.dwell_chunks = 2, .min_chunks = 0});
  EXPECT_FALSE(meter.Rest(At(0), Stay(0), Stay(0)));
  EXPECT_FALSE(meter.Rest(At(0), Stay(.02), Stay(0)));
  EXPECT_FALSE(meter.Rest(At(.02), Stay(.02), Stay(.02)));
  EXPECT_TRUE(meter.Rest(At(.02), Stay(.02), Stay(.02)));
}

TEST(Still, AStuckArmThatIsStillCommandedHasNotFinished) {
  StillMeter meter({.dwell_chunks = 1, .min_chunks = 0});
  EXPECT_FALSE(meter.Rest(At(0), Stay(.1), Stay(0)));
}

TEST(Still, ACoastingArmThatIsNoLongerCommandedHasNotFinished) {
  StillMeter meter({.dwell_chunks = 1, .min_chunks = 0});
  const std::vector<Arms> coasting = {At(.1), At(.05), At(.01)};
  EXPECT_FALSE(meter.Rest(At(0), Stay(0), coasting));
}

TEST(Still, AClosingGripperIsMotion) {
  StillMeter meter({.dwell_chunks = 1, .min_chunks = 0});
  EXPECT_FALSE(meter.Rest(At(0, 0), Stay(0, 1), {}));
}

Arms Turned(double turn_rad, double x_m = 0, double closure = 0) {
  Arms arms = At(x_m, closure);
  arms[0].base_from_gripper.rotate(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()));
  return arms;
}

TEST(Still, ATurningHandIsMotion) {
  const std::vector<Arms> turning = {At(0), Turned(.3)};
  StillMeter commanded({.dwell_chunks = 1, .min_chunks = 0}), coasting({.dwell_chunks = 1, .min_chunks = 0});
  EXPECT_FALSE(commanded.Rest(At(0), turning, {}));
  EXPECT_FALSE(coasting.Rest(At(0), Stay(0), turning));
  EXPECT_TRUE(coasting.Rest(At(0), Stay(0), Stay(0)));
}

TEST(Still, TheSentenceSaysHowFarTheCommandAndTheGripperWentAndTheLimits) {
  StillMeter meter({.translation_m = .006, .rotation_rad = .04, .closure = .05, .dwell_chunks = 2, .min_chunks = 2});
  const std::vector<Arms> told = {At(0, .1), Turned(.01, .001, .12)}, seen = {At(0, .1), Turned(.02, .002, .13)};
  EXPECT_FALSE(meter.Rest(At(0, .1), told, seen));
  EXPECT_FALSE(meter.Rest(At(0, .1), told, seen));
  EXPECT_EQ(meter.Rest(At(0, .1), told, seen),
            "still for 3 chunks: the commanded gripper moves at most 1.0 mm, 0.010 rad, closure 0.020, the observed "
            "one moved 2.0 mm, 0.020 rad, closure 0.030 (limits 6.0 mm, 0.040 rad, closure 0.050), after 2 chunks");
}

/// It said how far the last chunk went, of all the chunks for which it was still.
TEST(Still, TheSentenceIsOfTheFarthestOfTheChunksThatItCounts) {
  StillMeter meter({.translation_m = .03, .dwell_chunks = 3, .min_chunks = 0});
  const auto rest = [&](double told_m, double seen_m) {
    return meter.Rest(At(0), std::vector<Arms>{At(told_m)}, std::vector<Arms>{At(0), At(seen_m)});
  };
  EXPECT_FALSE(rest(.020, .020));
  EXPECT_FALSE(rest(.040, .004)) << "begins anew";
  EXPECT_FALSE(rest(.005, .001));
  EXPECT_FALSE(rest(.001, .007));
  EXPECT_THAT(rest(.002, .003).value_or("it goes on"),
              AllOf(HasSubstr("still for 3 chunks: the commanded gripper moves at most 5.0 mm"),
                    HasSubstr("the observed one moved 7.0 mm")));
}

/// "Still moving" was said of arms that had not moved.
TEST(Still, AtTheLimitItSaysWhetherItMovedAndWhetherARuleAsked) {
  StillMeter without({.enabled = false}), moving({.dwell_chunks = 9}), resting({.dwell_chunks = 9, .min_chunks = 1});
  for (int chunk = 0; chunk < 4; ++chunk) {
    EXPECT_FALSE(without.Rest(At(0), Stay(0), Stay(0)));
    EXPECT_FALSE(moving.Rest(At(0), std::vector<Arms>{At(.1)}, {}));
    EXPECT_FALSE(resting.Rest(At(0), std::vector<Arms>{At(chunk == 0 ? .1 : 0)}, {}));
  }
  EXPECT_EQ(without.AtLimit(), "after 4 chunks, the task's limit; no rule says when it rests");
  EXPECT_EQ(moving.AtLimit(), "still moving after 4 chunks, the task's limit");
  EXPECT_EQ(resting.AtLimit(), "after 4 chunks, the task's limit, still for the last 3 (dwell_chunks 9, min_chunks 1)");
}

TEST(Still, WhereArmsAreOnlyCommandedTheCommandDecides) {
  StillMeter meter({.dwell_chunks = 1, .min_chunks = 0});
  const auto sentence = meter.Rest(At(0), Stay(.001), {});
  ASSERT_TRUE(sentence);
  EXPECT_NE(sentence->find("is not measured"), std::string::npos) << *sentence;
  EXPECT_NE(sentence->find("1.0 mm"), std::string::npos) << *sentence;
}

TEST(Still, ARecordingThatIsReplayedNeverRests) {
  StillMeter meter({.enabled = false, .dwell_chunks = 1, .min_chunks = 0});
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(meter.Rest(At(0), Stay(0), Stay(0)));
}

TEST(Still, TheLargestMotionIsOverAllArmsAndTimes) {
  Arms start = {At(0).front(), At(0).front()};
  Arms later = start;
  later[1].base_from_gripper.rotate(Eigen::AngleAxisd(.3, Eigen::Vector3d::UnitZ()));
  later[0].closure = .4;
  const Motion motion = LargestMotion(start, std::vector<Arms>{later, start});
  EXPECT_NEAR(motion.rotation_rad, .3, 1e-12);
  EXPECT_DOUBLE_EQ(motion.closure, .4);
  EXPECT_DOUBLE_EQ(motion.translation_m, 0);
}

}  // namespace
}  // namespace evac
