#include "worldmodel/echo_world.h"

#include <gmock/gmock.h>

#include "core/check.h"
#include "core/error.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr int kSteps = 6;
const InitialState kStart{"recording", 0};

/// A recording on disk, an echo of it, and the task to do what was recorded.
class EchoWorldTest : public testing::Test {
 protected:
  EchoWorldTest() { SyntheticClip(kSteps).Write(OneFolder(folder_ / "clip")); }

  static int GreyOf(const WorldStep& step) { return step.observation.images.at(0).at<cv::Vec3b>(5, 5)[1]; }
  static std::vector<WorldStep> Steps(const Advanced& advanced) { return std::get<std::vector<WorldStep>>(advanced); }

  /// The recorded steps `from` … `from + count - 1` as a chunk.
  ActionChunk Chunk(std::size_t from, std::size_t count) const {
    ActionChunk chunk;
    for (std::size_t k = from; k < from + count; ++k)
      chunk.targets.push_back(recording().arms.at(std::min<std::size_t>(k, kSteps - 1)));
    return chunk;
  }
  const Recording& recording() const {
    if (!recording_) recording_ = ReadRecording(folder_ / "clip");
    return *recording_;
  }

  TempFolder folder_;
  mutable std::optional<Recording> recording_;
};

TEST_F(EchoWorldTest, AnswersWithTheRecordingsFramesInOrderAndThenTheLastOneStays) {
  EchoWorld world(recording());
  const Task task = TaskFromRecording(recording());
  EXPECT_EQ(world.Name(), "echo");
  const WorldStep first = world.Reset(0, task, kStart, 1);
  EXPECT_EQ(WhatIsWrong(first.observation, task), std::nullopt);
  EXPECT_NEAR(GreyOf(first), SyntheticClip::FrameGrey(0), 3);
  const ActionChunk chunk = Chunk(1, 7);
  const std::vector<SceneChunk> batch = {{0, &chunk}};
  const std::vector<WorldStep> steps = Steps(world.Advance(batch).at(0));
  ASSERT_EQ(steps.size(), 7u);
  for (int k = 0; k < 7; ++k)
    EXPECT_NEAR(GreyOf(steps[k]), SyntheticClip::FrameGrey(std::min(k + 1, kSteps - 1)), 3) << k;
}

TEST_F(EchoWorldTest, TheArmsItShowsAreTheCommandedOnesAndItSaysSo) {
  EchoWorld world(recording());
  const WorldStep first = world.Reset(0, TaskFromRecording(recording()), kStart, 1);
  EXPECT_TRUE(first.observation.arms_are_commanded);
  EXPECT_TRUE(first.observation.arms[1].base_from_gripper.isApprox(recording().arms[0][1].base_from_gripper));
  ActionChunk chunk = Chunk(1, 1);
  chunk.targets[0][1].base_from_gripper.translation() = Eigen::Vector3d(.1, .2, .3);
  const std::vector<SceneChunk> batch = {{0, &chunk}};
  const WorldStep step = Steps(world.Advance(batch).at(0)).at(0);
  EXPECT_TRUE(step.observation.arms_are_commanded);
  EXPECT_EQ(step.observation.arms[1].base_from_gripper.translation(), Eigen::Vector3d(.1, .2, .3));
  EXPECT_TRUE(step.privileged.bodies.empty());
}

TEST_F(EchoWorldTest, ScenesWalkOnTheirOwnAndResetBeginsAgain) {
  EchoWorld world(recording());
  const Task task = TaskFromRecording(recording());
  world.Reset(0, task, kStart, 1);
  world.Reset(1, task, kStart, 1);
  const ActionChunk three = Chunk(1, 3), one = Chunk(1, 1);
  const std::vector<SceneChunk> ahead = {{1, &three}}, both = {{1, &one}, {0, &one}};
  world.Advance(ahead);
  const std::vector<Advanced> answers = world.Advance(both);
  EXPECT_NEAR(GreyOf(Steps(answers[0]).at(0)), SyntheticClip::FrameGrey(4), 3);
  EXPECT_NEAR(GreyOf(Steps(answers[1]).at(0)), SyntheticClip::FrameGrey(1), 3);
  EXPECT_NEAR(GreyOf(world.Reset(1, task, kStart, 2)), SyntheticClip::FrameGrey(0), 3);
}

TEST_F(EchoWorldTest, WhereThereIsNoVideoTheFirstFrameStays) {
  Recording still = recording();
  still.videos.clear();
  EchoWorld world(still);
  world.Reset(0, TaskFromRecording(still), kStart, 1);
  const ActionChunk chunk = Chunk(1, 4);
  const std::vector<SceneChunk> batch = {{0, &chunk}};
  const std::vector<WorldStep> steps = Steps(world.Advance(batch).at(0));
  ASSERT_EQ(steps.size(), 4u);
  for (const WorldStep& step : steps) EXPECT_NEAR(GreyOf(step), SyntheticClip::FrameGrey(0), 3);
}

TEST_F(EchoWorldTest, ATaskWithOtherArmsOrCamerasIsRefused) {
  EchoWorld world(recording());
  Task task = TaskFromRecording(recording());
  task.arms = {"right"};
  EXPECT_THROW(world.Reset(0, task, kStart, 1), Error);
  task = TaskFromRecording(recording());
  task.cameras[0].width_px = 96;
  EXPECT_THROW(world.Reset(0, task, kStart, 1), Error);
  task.cameras.clear();
  EXPECT_THROW(world.Reset(0, task, kStart, 1), Error);
}

TEST_F(EchoWorldTest, AVideoThatEndsEarlyFailsItsSceneAndNoOther) {
  SyntheticClip clip(kSteps);
  clip.frames = 3;
  clip.Write(OneFolder(folder_ / "short"));
  EchoWorld world(ReadRecording(folder_ / "short", {.count_video_frames = false}));
  const Task task = TaskFromRecording(recording());
  world.Reset(0, task, kStart, 1);
  world.Reset(1, task, kStart, 1);
  const ActionChunk four = Chunk(1, 4), two = Chunk(1, 2);
  const std::vector<SceneChunk> batch = {{0, &four}, {1, &two}};
  const std::vector<Advanced> answers = world.Advance(batch);
  ASSERT_TRUE(std::holds_alternative<Failure>(answers[0]));
  EXPECT_EQ(std::get<Failure>(answers[0]).stop, StopReason::kWorldError);
  EXPECT_THAT(std::get<Failure>(answers[0]).message,
              testing::HasSubstr("head_color.mp4: the video ends before step 3"));
  EXPECT_EQ(Steps(answers[1]).size(), 2u);
}

}  // namespace
}  // namespace evac
