#include "worldmodel/trained_for.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/motion_statistics.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

ActionStatistics OfTheDesk() {
  ActionStatistics statistics{"desk", {}, {}};
  statistics.deviation.fill(1);
  statistics.mean[6] = 5.906391571280259e-05;
  statistics.deviation[6] = 0.0027048793830209386;
  return statistics;
}

TrainedFor Desk() {
  return TrainedFor::Of("desk.safetensors", {{"period_s", "0.1"},
                                             {"cameras", "head,hand_right"},
                                             {"arms", "right"},
                                             {"statistics", StatisticsPage(OfTheDesk())},
                                             {"pose_map", "radius_px=10 thickness_px=2"},
                                             {"arms_read", "told"}});
}

TEST(TrainedFor, WeightsThatSayNothingMayBeAskedForAnything) {
  const TrainedFor trained = TrainedFor::Of("published.ckpt", {{"format", "pt"}});
  EXPECT_NO_THROW(trained.CheckPeriod(0.2, "world evac"));
  EXPECT_NO_THROW(trained.CheckCameras({"front"}, "world evac"));
  EXPECT_NO_THROW(trained.CheckArms({"left", "right"}, "world evac"));
  EXPECT_NO_THROW(trained.CheckPoseMap("radius_px=50 thickness_px=8", "world evac"));
  EXPECT_EQ(trained.StatisticsOr(std::nullopt).robot, "agibotworld");
  EXPECT_EQ(trained.arms_read, "");
}

TEST(TrainedFor, WhatTheyWereTrainedForIsNotRefused) {
  const TrainedFor trained = Desk();
  EXPECT_NO_THROW(trained.CheckPeriod(0.1, "world evac"));
  EXPECT_NO_THROW(trained.CheckCameras({"head", "hand_right"}, "world evac"));
  EXPECT_NO_THROW(trained.CheckArms({"right"}, "world evac"));
  EXPECT_NO_THROW(trained.CheckPoseMap("radius_px=10 thickness_px=2", "world evac"));
  EXPECT_EQ(trained.arms_read, "told");
}

TEST(TrainedFor, AnotherPeriodIsRefusedWithBoth) {
  EXPECT_THAT([] { Desk().CheckPeriod(0.2, "world evac"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("world evac"), HasSubstr("0.2 s"), HasSubstr("0.1 s"),
                                                HasSubstr("desk.safetensors"))));
}

TEST(TrainedFor, OtherCamerasAndTheSameInAnotherOrderAreRefusedWithBoth) {
  EXPECT_THAT([] { Desk().CheckCameras({"hand_right", "head"}, "task take_ham"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("task take_ham"), HasSubstr("found cameras hand_right, head"),
                                                HasSubstr("wanted head, hand_right"))));
  EXPECT_THROW(Desk().CheckCameras({"head"}, ""), Error);
  EXPECT_THROW(Desk().CheckCameras({"head", "hand_left"}, ""), Error);
}

TEST(TrainedFor, OneArmWhereTwoWereAndTheReverseAreRefusedWithBoth) {
  EXPECT_THAT([] { Desk().CheckArms({"left", "right"}, "task carry"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("task carry: found arms left, right, wanted right"),
                                         HasSubstr("desk.safetensors"))));
  const TrainedFor two = TrainedFor::Of("two.safetensors", {{"arms", "left,right"}});
  EXPECT_NO_THROW(two.CheckArms({"left", "right"}, ""));
  EXPECT_THROW(two.CheckArms({"right"}, ""), Error);
}

TEST(TrainedFor, MapsDrawnOtherwiseAreRefused) {
  EXPECT_THAT([] { Desk().CheckPoseMap("radius_px=50 thickness_px=8", "world evac"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("radius_px=50"), HasSubstr("radius_px=10"))));
}

TEST(TrainedFor, TheWeightsOwnStatisticsAreTakenWhereNoPageIsGiven) {
  const ActionStatistics found = Desk().StatisticsOr(std::nullopt), wanted = OfTheDesk();
  EXPECT_EQ(found.robot, "desk");
  EXPECT_EQ(found.mean, wanted.mean) << "to the last bit";
  EXPECT_EQ(found.deviation, wanted.deviation);
}

TEST(TrainedFor, StatisticsOfAnotherRobotAreRefusedWithWhatDiffers) {
  const TempFolder folder;
  WriteFileAtomically(folder / "mine.yaml", StatisticsPage(OfTheDesk()));
  EXPECT_EQ(Desk().StatisticsOr(folder / "mine.yaml").deviation, OfTheDesk().deviation);

  ActionStatistics other = OfTheDesk();
  other.deviation[6] = 0.000943621432585622;
  WriteFileAtomically(folder / "other.yaml", StatisticsPage(other));
  EXPECT_THAT([&] { Desk().StatisticsOr(folder / "other.yaml"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("other.yaml"), HasSubstr("desk.safetensors"),
                                                HasSubstr("deviation of right x: found 0.000943621, wanted 0.00270488"))));
  other = OfTheDesk();
  other.mean[2] = 1e-5;
  WriteFileAtomically(folder / "mean.yaml", StatisticsPage(other));
  EXPECT_THAT([&] { Desk().StatisticsOr(folder / "mean.yaml"); },
              ThrowsMessage<Error>(HasSubstr("mean of left z: found 1e-05, wanted 0")));
}

/// A mean of 5.6e-20, the noise of rounding, wanted the same 5.6e-20: 0 was another robot's.
TEST(TrainedFor, AMeanCountsAgainstItsDeviationAlone) {
  ActionStatistics noisy = OfTheDesk();
  noisy.mean[7] = 5.557200473554684e-20;
  noisy.deviation[7] = 0.003;
  const TrainedFor trained = TrainedFor::Of("w.safetensors", {{"statistics", StatisticsPage(noisy)}});
  ActionStatistics asked = noisy;
  asked.mean[7] = 0;
  EXPECT_NO_THROW(trained.CheckStatistics(asked, "suite"));
  asked.mean[7] = 1e-6;
  EXPECT_THAT([&] { trained.CheckStatistics(asked, "suite"); },
              ThrowsMessage<Error>(HasSubstr("mean of right y: found 1e-06, wanted 5.5572e-20")));
}

TEST(TrainedFor, MetadataThatMakeNoSenseAreRefusedByName) {
  for (const char* period : {"fast", "0", "-1", "nan", "0.1s"}) {
    EXPECT_THAT([&] { TrainedFor::Of("w.safetensors", {{"period_s", period}}); },
                ThrowsMessage<Error>(AllOf(HasSubstr("w.safetensors"), HasSubstr("period_s"), HasSubstr(period))));
  }
  EXPECT_THAT([] { TrainedFor::Of("w.safetensors", {{"statistics", "robot: x\nmean: [1]\ndeviation: [1]\n"}}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("w.safetensors"), HasSubstr("mean"))));
}

}  // namespace
}  // namespace evac
