#include "apps/networks/train_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/hash.h"
#include "core/weight_file.h"
#include "policies/learned_input.h"
#include "policies/learned_policy.h"
#include "tests/apps/learning_shards.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

PolicyOptions Quick(std::int64_t steps) {
  PolicyOptions options;
  options.batch = 8;
  options.job.trainer.steps = steps;
  options.job.trainer.learning_rate = 1e-3;
  options.job.trainer.clip_norm = 1;
  options.job.trainer.average_decay = 0.9;
  options.job.trainer.checkpoint_every_s = 0;
  options.job.trainer.seed = 3;
  return options;
}

class TrainPolicyTest : public testing::Test {
 protected:
  void SetUp() override { WriteLearningShards(folder_ / "shards", {}); }
  train::JobPlace Place(const std::string& out) const {
    train::JobPlace place;
    place.shards = folder_ / "shards";
    place.out = folder_ / out;
    return place;
  }
  double Holdout(const std::string& file) const { return WeightFile(folder_ / file, kLearnedFormat).Number("holdout"); }
  const TempFolder folder_;
};

TEST_F(TrainPolicyTest, CheckpointsOfOneTrainingGetBetter) {
  TrainPolicy(Place("policy"), Quick(60), {2, 20});
  EXPECT_LT(Holdout("policy/policy_000020.safetensors"), Holdout("policy/policy_000002.safetensors"));
  EXPECT_LT(Holdout("policy/policy.safetensors"), 0.8 * Holdout("policy/policy_000020.safetensors"));
  const LearnedPolicy policy(folder_ / "policy" / "policy_000020.safetensors", 8);
  EXPECT_EQ(policy.Spec().checkpoint, "policy_000020");
  EXPECT_EQ(policy.Spec().period_s, 0.1);
}

TEST_F(TrainPolicyTest, InterruptedAndGoneOnWithItEndsInTheSameBytes) {
  TrainPolicy(Place("whole"), Quick(10), {4});
  train::JobPlace place = Place("parts");
  int steps = 0;
  place.interrupted = [&] { return ++steps % 4 == 0; };
  int runs = 0;
  while (!TrainPolicy(place, Quick(10), {4}).IsDone()) ++runs;
  EXPECT_EQ(runs, 3);
  for (const char* file : {"policy.safetensors", "policy_000004.safetensors"})
    EXPECT_EQ(Sha256HexOfFile(folder_ / "parts" / file), Sha256HexOfFile(folder_ / "whole" / file)) << file;
}

TEST_F(TrainPolicyTest, OnlySuccessesOfTheWantedBehavioursAreImitated) {
  const PackedSet set(folder_ / "shards", train::Split::kTrain);
  EXPECT_EQ(PolicyTraining(set, Quick(1)).clips(), set.clips.size() / 2);
  PolicyOptions options = Quick(1);
  options.behaviours = "";
  EXPECT_EQ(PolicyTraining(set, options).clips(), set.clips.size() / 2) << "all behaviours, successes alone";
  options.behaviours = "push,roam";
  EXPECT_THAT([&] { PolicyTraining(set, options); },
              ThrowsMessage<Error>(HasSubstr("none of 24 clips is a success of behaviours 'push,roam'")));
}

TEST_F(TrainPolicyTest, TheCardKeepsTheCamerasOfTheShards) {
  const std::vector<Camera> cameras = CamerasOf(PackedSet(folder_ / "shards", train::Split::kTrain));
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].mount, Mount::kBase);
  EXPECT_NEAR(cameras[0].mount_from_camera.translation().z(), 1, 1e-6);
  EXPECT_EQ(cameras[1].mount, Mount::kRightGripper);
  // The gripper, at (.3, 0, .1) and upside down, carries a camera that stands at (.4, 0, 1).
  EXPECT_TRUE(cameras[1].mount_from_camera.translation().isApprox(Eigen::Vector3d(0.1, 0, -0.9), 1e-5));
}

}  // namespace
}  // namespace evac
