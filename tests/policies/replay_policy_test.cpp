#include "policies/replay_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace evac {
namespace {

/// `steps` rows whose x counts them.
Recording Counting(int steps) {
  Recording recording;
  recording.id = "counting";
  recording.period_s = 0.1;
  recording.arm_names = {"right"};
  for (int step = 0; step < steps; ++step) {
    ArmState arm;
    arm.base_from_gripper.translation().x() = step;
    recording.arms.push_back({arm});
  }
  return recording;
}

std::vector<double> Rows(const Acted& acted) {
  std::vector<double> rows;
  for (const Arms& target : std::get<ActionChunk>(acted).targets)
    rows.push_back(target[0].base_from_gripper.translation().x());
  return rows;
}

TEST(ReplayPolicy, EveryRowAfterTheStartIsPlayedOnceAndTheLastChunkEndsIt) {
  ReplayPolicy policy(Counting(8), 3);
  policy.Reset(0, Task(), 1);
  const Observation observation;
  const SceneObservation asked{0, &observation};
  const Acted first = policy.Act({&asked, 1})[0], second = policy.Act({&asked, 1})[0],
              third = policy.Act({&asked, 1})[0];
  EXPECT_EQ(Rows(first), (std::vector<double>{1, 2, 3}));
  EXPECT_FALSE(std::get<ActionChunk>(first).ends_recording);
  EXPECT_EQ(Rows(second), (std::vector<double>{4, 5, 6}));
  EXPECT_EQ(Rows(third), (std::vector<double>{7}));
  EXPECT_TRUE(std::get<ActionChunk>(third).ends_recording);
  EXPECT_TRUE(std::holds_alternative<Failure>(policy.Act({&asked, 1})[0]));
}

TEST(ReplayPolicy, WhereTheRecordingSaysItTheToldArmsArePlayed) {
  Recording recording = Counting(4);
  recording.told = {recording.arms[0], recording.arms[2], recording.arms[3], recording.arms[3]};
  ReplayPolicy policy(recording, 3);
  policy.Reset(0, Task(), 1);
  const Observation observation;
  const SceneObservation asked{0, &observation};
  EXPECT_EQ(Rows(policy.Act({&asked, 1})[0]), (std::vector<double>{2, 3, 3}));
}

TEST(ReplayPolicy, ARecordingThatFillsItsLastChunkEndsWithIt) {
  ReplayPolicy policy(Counting(4), 3);
  policy.Reset(0, Task(), 1);
  const Observation observation;
  const SceneObservation asked{0, &observation};
  EXPECT_TRUE(std::get<ActionChunk>(policy.Act({&asked, 1})[0]).ends_recording);
}

TEST(ReplayPolicy, ScenesPlayOnTheirOwn) {
  ReplayPolicy policy(Counting(8), 3);
  const Observation observation;
  policy.Reset(0, Task(), 1);
  policy.Reset(1, Task(), 1);
  const SceneObservation ahead{0, &observation}, both[] = {{0, &observation}, {1, &observation}};
  policy.Act({&ahead, 1});
  const auto answers = policy.Act(both);
  EXPECT_EQ(Rows(answers[0]), (std::vector<double>{4, 5, 6}));
  EXPECT_EQ(Rows(answers[1]), (std::vector<double>{1, 2, 3}));
  policy.Reset(0, Task(), 1);
  EXPECT_EQ(Rows(policy.Act({&ahead, 1})[0]), (std::vector<double>{1, 2, 3}));
}

TEST(ReplayPolicy, AnotherRobotOrRateIsRefused) {
  ReplayPolicy policy(Counting(8), 3);
  Task task;
  task.arms = {"left", "right"};
  task.id = "take";
  const auto refuses = [](const char* message) { return testing::ThrowsMessage<Error>(message); };
  EXPECT_THAT([&] { policy.Reset(0, task, 1); },
              refuses("recording counting: its arms are right, task take has left, right"));
  task.arms = {"right"};
  task.period_s = 0.05;
  EXPECT_THAT([&] { policy.Reset(0, task, 1); },
              refuses("recording counting: its period is 0.1 s, task take has 0.05 s"));
  EXPECT_THAT([] { ReplayPolicy(Counting(1), 3); }, refuses("recording counting: 1 steps, wanted at least 2"));
}

}  // namespace
}  // namespace evac
