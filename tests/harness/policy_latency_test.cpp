#include "harness/policy_latency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace evac {
namespace {

using testing::ElementsAre;

Arms At(double x_m) {
  Arms arms(1);
  arms[0].base_from_gripper.translation().x() = x_m;
  return arms;
}

ActionChunk Chunk(int first, int count, double thinking_s = 0) {
  ActionChunk chunk;
  for (int k = 0; k < count; ++k) chunk.targets.push_back(At(first + k));
  chunk.thinking_s = thinking_s;
  return chunk;
}

std::vector<double> Xs(const ActionChunk& chunk) {
  std::vector<double> xs;
  for (const Arms& target : chunk.targets) xs.push_back(target[0].base_from_gripper.translation().x());
  return xs;
}

const PolicyLatency kTwoPeriods{.kind = PolicyLatency::Kind::kFixed, .fixed_s = 0.2};

TEST(PolicyLatency, OffAChunkIsCutToWhatIsExecuted) {
  ExecutedPlan plan({}, 3);
  EXPECT_THAT(Xs(plan.Execute(At(0), Chunk(1, 5, 9.0), 0.1)), ElementsAre(1, 2, 3));
  EXPECT_THAT(Xs(plan.Execute(At(3), Chunk(11, 5, 9.0), 0.1)), ElementsAre(11, 12, 13));
}

TEST(PolicyLatency, WhereNothingIsLeftOfTheLastChunkTheArmsHoldAndNoTargetIsLost) {
  ExecutedPlan plan(kTwoPeriods, 3);
  EXPECT_THAT(Xs(plan.Execute(At(0), Chunk(1, 3), 0.1)), ElementsAre(0, 0, 1, 2, 3));
  EXPECT_THAT(Xs(plan.Execute(At(3), Chunk(4, 3), 0.1)), ElementsAre(3, 3, 4, 5, 6));
}

TEST(PolicyLatency, TheLastChunkGoesOnAndTheNewOneContinuesWhereThePlanIs) {
  ExecutedPlan plan(kTwoPeriods, 3);
  EXPECT_THAT(Xs(plan.Execute(At(0), Chunk(1, 6), 0.1)), ElementsAre(0, 0, 1, 2, 3));
  EXPECT_THAT(Xs(plan.Execute(At(3), Chunk(4, 6), 0.1)), ElementsAre(4, 5, 6, 7, 8)) << "4 and 5 were the old chunk's";
}

TEST(PolicyLatency, OneThatGoesOnForALittleHoldsForTheRest) {
  ExecutedPlan plan(kTwoPeriods, 3);
  plan.Execute(At(0), Chunk(1, 4), 0.1);
  EXPECT_THAT(Xs(plan.Execute(At(3), Chunk(4, 4), 0.1)), ElementsAre(4, 4, 5, 6, 7));
}

TEST(PolicyLatency, MeasuredTimeIsRoundedUpToWholePeriods) {
  const PolicyLatency measured{.kind = PolicyLatency::Kind::kMeasured, .fixed_s = 0};
  EXPECT_EQ(measured.Periods(0.21, 0.1), 3);
  EXPECT_EQ(measured.Periods(0, 0.1), 0);
  EXPECT_EQ((PolicyLatency{.kind = PolicyLatency::Kind::kFixed, .fixed_s = 0.3}.Periods(0, 0.1)), 3);
  EXPECT_EQ(PolicyLatency{}.Periods(5, 0.1), 0);
}

TEST(PolicyLatency, ARecordingEndsWithItsLastTarget) {
  ExecutedPlan plan(kTwoPeriods, 3);
  ActionChunk last = Chunk(1, 2);
  last.ends_recording = true;
  EXPECT_TRUE(plan.Execute(At(0), last, 0.1).ends_recording);
  last = Chunk(1, 4);
  last.ends_recording = true;
  EXPECT_FALSE(plan.Execute(At(0), last, 0.1).ends_recording);
}

}  // namespace
}  // namespace evac
