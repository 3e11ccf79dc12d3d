#include "apps/networks/train_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/networks/learners.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/weight_file.h"
#include "policies/learned_input.h"
#include "policies/learned_policy.h"
#include "tests/apps/learning_shards.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/sha256.h"

namespace evac {
namespace {

using testing::AllOf;
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
    place.shards = {folder_ / "shards"};
    place.out = folder_ / out;
    return place;
  }
  double Holdout(const std::string& file) const { return WeightFile(folder_ / file, kLearnedFormat).Number("holdout"); }
  const TempFolder folder_;
};

TEST_F(TrainPolicyTest, CheckpointsOfOneTrainingGetBetter) {
  TrainPolicy(Place("policy"), Quick(60), nullptr, {2, 20});
  EXPECT_LT(Holdout("policy/policy_000020.safetensors"), Holdout("policy/policy_000002.safetensors"));
  EXPECT_LT(Holdout("policy/policy.safetensors"), 0.8 * Holdout("policy/policy_000020.safetensors"));
  const LearnedPolicy policy(folder_ / "policy" / "policy_000020.safetensors", 8);
  EXPECT_EQ(policy.Spec().checkpoint, "policy_000020");
  EXPECT_EQ(policy.Spec().period_s, 0.1);
}

TEST_F(TrainPolicyTest, CardsSayWhichStepTheirWeightsAreOf) {
  PolicyOptions options = Quick(6);
  options.job.trainer.holdout_every = 3;
  const train::TrainerSummary summary = TrainPolicy(Place("policy"), options, nullptr, {2});
  const auto card = [&](const char* file) { return TensorFile::Open(folder_ / "policy" / file).metadata(); };
  EXPECT_EQ(card("policy.safetensors").at("steps"), "6");
  EXPECT_EQ(card("policy.safetensors").at("best_step"), std::to_string(summary.best_step));
  EXPECT_EQ(card("policy_000002.safetensors").at("steps"), "2");
  EXPECT_FALSE(card("policy_000002.safetensors").contains("best_step")) << "kept, the best or not";
}

TEST_F(TrainPolicyTest, InterruptedAndGoneOnWithItEndsInTheSameBytes) {
  TrainPolicy(Place("whole"), Quick(10), nullptr, {4});
  train::JobPlace place = Place("parts");
  int steps = 0;
  place.interrupted = [&] { return ++steps % 4 == 0; };
  int runs = 0;
  while (!TrainPolicy(place, Quick(10), nullptr, {4}).IsDone()) ++runs;
  EXPECT_EQ(runs, 3);
  for (const char* file : {"policy.safetensors", "policy_000004.safetensors"})
    EXPECT_EQ(Sha256HexOfFile(folder_ / "parts" / file), Sha256HexOfFile(folder_ / "whole" / file)) << file;
}

TEST_F(TrainPolicyTest, AStepThatWasDoneWithoutBeingKeptIsRefused) {
  TrainPolicy(Place("policy"), Quick(6), nullptr, {2});
  EXPECT_TRUE(TrainPolicy(Place("policy"), Quick(6), nullptr, {2}).IsDone()) << "asked again";
  for (const std::int64_t step : {4, 6})
    EXPECT_THAT([&] { TrainPolicy(Place("policy"), Quick(6), nullptr, {2, step}); },
                ThrowsMessage<Error>(HasSubstr("the training has done 6 and did not keep it"))) << step;
}

TEST_F(TrainPolicyTest, OnlySuccessesOfTheWantedBehavioursAreImitated) {
  const PackedSet set({folder_ / "shards"}, train::Split::kTrain);
  EXPECT_EQ(PolicyTraining(set, Quick(1), nullptr).clips(), set.clips.size() / 2);
  PolicyOptions options = Quick(1);
  options.behaviours = "";
  EXPECT_EQ(PolicyTraining(set, options, nullptr).clips(), set.clips.size() / 2) << "all behaviours, successes alone";
  options.behaviours = "push,roam";
  EXPECT_THAT([&] { PolicyTraining(set, options, nullptr); },
              ThrowsMessage<Error>(HasSubstr("none of 24 clips is a success of behaviours 'push,roam'")));
}

/// They counted as 1, or as 0, and hours later nobody saw it.
TEST_F(TrainPolicyTest, OptionsOutOfRangeAreRefusedByName) {
  const PackedSet set({folder_ / "shards"}, train::Split::kTrain);
  const std::pair<std::string, double> wrong[] = {{"contact_share", 50},       {"arm_noise_m", std::nan("")},
                                                  {"object_weight", -1},       {"reconstructed_share", -1},
                                                  {"light", 2},                {"offset", -0.1},
                                                  {"blur_share", 25}};
  for (const auto& [name, value] : wrong) {
    PolicyOptions options = Quick(1);
    for (const train::Setting& setting : SettingsOf(options)) {
      if (setting.name == name) *std::get<double*>(setting.field) = value;
    }
    EXPECT_THAT([&] { PolicyTraining(set, options, nullptr); },
                ThrowsMessage<TensorError>(HasSubstr("policy training: " + name + " is "))) << name;
  }
}

/// No copy of the network was made, and the first of none was trained.
TEST_F(TrainPolicyTest, AStepOfNoPartsIsRefused) {
  PolicyOptions options = Quick(2);
  options.job.trainer.accumulate = 0;
  EXPECT_THAT([&] { TrainPolicy(Place("policy"), options, nullptr, {}); },
              ThrowsMessage<TensorError>(HasSubstr("training: accumulate is 0")));
}

/// Its hold-out counted twice too.
TEST_F(TrainPolicyTest, AFolderThatIsNamedTwiceIsDrawnFromTwiceAndMeasuredOnce) {
  train::JobPlace place = Place("policy");
  place.shards = {folder_ / "shards", folder_ / "shards"};
  std::string said;
  place.say = [&](const std::string& line) { said += line + "\n"; };
  TrainPolicy(place, Quick(1), nullptr, {});
  EXPECT_THAT(said, HasSubstr("24 clips to imitate, 12 to measure with"));
}

/// It ended in the first step, in libtorch's words: "shape is invalid for input".
TEST_F(TrainPolicyTest, PicturesWhoseSidesAreNoMultiplesOfEightAreRefusedBeforeTheFirstStep) {
  for (const auto& [height_px, width_px] : {std::pair(20, 24), std::pair(16, 28)}) {
    WriteLearningShards(folder_ / "shards", {.clips = 8, .height_px = height_px, .width_px = width_px});
    const std::string found = std::to_string(width_px) + "x" + std::to_string(height_px);
    EXPECT_THAT([&] { TrainPolicy(Place("policy"), Quick(2), nullptr, {}); },
                ThrowsMessage<Error>(HasSubstr("pictures are " + found + ", wanted multiples of 8")));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "policy"));
  }
}

/// Every outcome times this: failures stay failures.
void MultiplyOutcomes(const std::filesystem::path& folder, int by) {
  for (const std::filesystem::path& shard : train::ShardPaths(folder)) {
    nn::MappedTensors file(TensorFile::Open(shard));
    std::vector<at::Tensor> tensors;
    std::vector<TensorView> views;
    for (const TensorView& view : file.file().tensors()) {
      at::Tensor tensor = file.Get(view.name).clone();
      if (view.name == "outcome") tensor.mul_(by);
      tensors.push_back(tensor);
      views.push_back(nn::ViewOf(view.name, tensors.back()));
    }
    WriteTensorFile(shard, views, file.file().metadata());
  }
}

TEST_F(TrainPolicyTest, ARobotsRecordingsWhoseOutcomeNobodyKnowsAreImitatedAndFailuresNever) {
  MultiplyOutcomes(folder_ / "shards", -1);
  const PackedSet set({folder_ / "shards"}, train::Split::kTrain);
  PolicyOptions options = Quick(2);
  EXPECT_THAT([&] { PolicyTraining(set, options, nullptr); },
              ThrowsMessage<Error>(HasSubstr("all are imitated with `behaviours: \"\"`")))
      << "a wanted behaviour must have succeeded";
  options.behaviours = "";
  EXPECT_EQ(PolicyTraining(set, options, nullptr).clips(), set.clips.size() / 2);
  TrainPolicy(Place("policy"), options, nullptr, {});
  EXPECT_EQ(WeightFile(folder_ / "policy" / "policy.safetensors", kLearnedFormat).Text("imitated_clips"), "12");
  MultiplyOutcomes(folder_ / "shards", 0);
  const PackedSet failures({folder_ / "shards"}, train::Split::kTrain);
  EXPECT_THAT([&] { PolicyTraining(failures, options, nullptr); },
              ThrowsMessage<Error>(HasSubstr("each of 24 clips is a failure")));
}

/// It was said of all clips, as if there were none to learn from, and named no way out.
TEST_F(TrainPolicyTest, AHoldOutWithNothingToImitateIsSaidToBeTheHoldOut) {
  const PackedSet set({folder_ / "shards"}, train::Split::kHoldout);
  PolicyOptions options = Quick(1);
  options.behaviours = "push";
  const std::string of_holdout = "24 clips of the hold-out of " + (folder_ / "shards").string() + " is a ";
  const auto refused = [&](const PackedSet& clips, const std::string& why) {
    EXPECT_THAT([&] { PolicyTraining(clips, options, nullptr); },
                ThrowsMessage<Error>(AllOf(HasSubstr(of_holdout + why), HasSubstr("`evac pack --holdout`"))));
  };
  refused(set, "success of behaviours 'push'");
  MultiplyOutcomes(folder_ / "shards", 0);
  options.behaviours = "";
  refused(PackedSet({folder_ / "shards"}, train::Split::kHoldout), "failure");
}

TEST_F(TrainPolicyTest, TheCardKeepsTheCamerasOfTheShards) {
  const std::vector<Camera> cameras = CamerasOf(PackedSet({folder_ / "shards"}, train::Split::kTrain));
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].mount, Mount::kBase);
  EXPECT_NEAR(cameras[0].mount_from_camera.translation().z(), 1, 1e-6);
  EXPECT_EQ(cameras[1].mount, Mount::kRightGripper);
  // The gripper, at (.3, 0, .1) and upside down, carries a camera that stands at (.4, 0, 1).
  EXPECT_TRUE(cameras[1].mount_from_camera.translation().isApprox(Eigen::Vector3d(0.1, 0, -0.9), 1e-5));
}

/// The same shards by cameras of other names.
void RenameCameras(const std::filesystem::path& folder, const std::string& cameras) {
  for (const auto& shard : train::ShardPaths(folder)) {
    nn::MappedTensors file(TensorFile::Open(shard));
    std::vector<at::Tensor> tensors;
    std::vector<TensorView> views;
    for (const TensorView& view : file.file().tensors()) {
      tensors.push_back(file.Get(view.name).clone());
      views.push_back(nn::ViewOf(view.name, tensors.back()));
    }
    TensorMetadata metadata = file.file().metadata();
    metadata["cameras"] = cameras;
    WriteTensorFile(shard, views, metadata);
  }
}

TEST_F(TrainPolicyTest, ACameraNamedAfterALeftHandThatIsNotThereIsCarriedByNone) {
  RenameCameras(folder_ / "shards", "head,hand_left");
  const std::vector<Camera> cameras = CamerasOf(PackedSet({folder_ / "shards"}, train::Split::kTrain));
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_EQ(cameras[1].mount, Mount::kBase);
  EXPECT_TRUE(cameras[1].mount_from_camera.translation().isApprox(Eigen::Vector3d(0.4, 0, 1), 1e-5));
}

/// The training clips, two by two, become crops of one recording: the first a part of it, with twice the focal length.
/// @param corner_px  where the second one's crop begins
void CropClips(const std::filesystem::path& folder, std::int64_t corner_px) {
  const std::filesystem::path shard = folder / "shard_00000.safetensors";
  nn::MappedTensors file(TensorFile::Open(shard));
  std::vector<at::Tensor> tensors;
  std::vector<TensorView> views;
  for (const TensorView& view : file.file().tensors()) {
    at::Tensor tensor = file.Get(view.name).clone();
    const at::Tensor starts = file.Get("clip_start");
    for (std::int64_t clip = 0; clip + 1 < starts.size(0); ++clip) {
      const bool is_part = clip % 2 == 0;
      const std::int64_t first = starts[clip].item<std::int64_t>();
      const std::int64_t frames = starts[clip + 1].item<std::int64_t>() - first;
      const std::vector<std::int64_t> part = {0, 0, 80, 60}, whole = {corner_px, 0, 96, 64};
      if (view.name == "clip_id") tensor[clip] = clip / 2;
      if (view.name == "crop") tensor[clip].copy_(at::tensor(is_part ? part : whole));
      if (view.name == "k" && is_part) tensor.narrow(0, first, frames).mul_(2);
    }
    tensors.push_back(tensor);
    views.push_back(nn::ViewOf(view.name, tensors.back()));
  }
  WriteTensorFile(shard, views, file.file().metadata());
}

TEST_F(TrainPolicyTest, AShardThatLacksAClipsRecordingIsRefused) {
  const std::filesystem::path shard = folder_ / "shards" / "shard_00000.safetensors";
  nn::MappedTensors file(TensorFile::Open(shard));
  std::vector<at::Tensor> tensors;
  std::vector<TensorView> views;
  for (const TensorView& view : file.file().tensors()) {
    const at::Tensor tensor = file.Get(view.name).clone();
    tensors.push_back(view.name == "clip_id" ? tensor.narrow(0, 0, tensor.size(0) - 1).contiguous() : tensor);
    views.push_back(nn::ViewOf(view.name, tensors.back()));
  }
  WriteTensorFile(shard, views, file.file().metadata());
  EXPECT_THAT([&] { PackedSet({folder_ / "shards"}, train::Split::kTrain); },
              ThrowsMessage<TensorError>(HasSubstr("shard_00000.safetensors: clip_id is ")));
}

TEST_F(TrainPolicyTest, TheCardsCamerasAreThoseOfAWholePicture) {
  const auto cameras = [&] { return CamerasOf(PackedSet({folder_ / "shards"}, train::Split::kTrain)); };
  const double whole_px = cameras().front().fx_px;
  CropClips(folder_ / "shards", 0);
  EXPECT_EQ(cameras().front().fx_px, whole_px) << "not that of the first clip, which shows a part";
  CropClips(folder_ / "shards", 3);
  EXPECT_THAT(cameras, ThrowsMessage<Error>(HasSubstr("none of 24 clips shows a whole picture")));
}

TEST_F(TrainPolicyTest, GoesOnOnlyWithWhatItWasBegunWith) {
  train::JobPlace place = Place("policy");
  TrainPolicy(place, Quick(2), nullptr, {});
  place.begun_with = " page another";
  EXPECT_THAT([&] { TrainPolicy(place, Quick(2), nullptr, {}); },
              ThrowsMessage<TensorError>(HasSubstr("is a training with other options")));
}

TEST_F(TrainPolicyTest, ItIsShownWhatTheCodecGivesBackAndNoOtherCodecsLatents) {
  const std::filesystem::path weights = EncodeLearningShards(folder_ / "shards", folder_ / "codec");
  const ShardCodec codec(weights, LearningCodec());
  PackedSet set({folder_ / "shards"}, train::Split::kTrain);
  codec.Open(set.shards);
  const LearnedShape shape{set.tasks, set.cameras, ArmsOf(set), 16, 24};
  const Learners<LearnedNet> learners(shape, 3, 1);
  const auto loss = [&](double share) {
    PolicyOptions options = Quick(1);
    options.reconstructed_share = share;
    return PolicyTraining(set, options, &codec).Loss(learners.net(), {3, 1, 0, 0}).item<double>();
  };
  PolicyOptions without = Quick(1);
  without.reconstructed_share = 1;
  const double as_seen = PolicyTraining(set, without, nullptr).Loss(learners.net(), {3, 1, 0, 0}).item<double>();
  EXPECT_NE(loss(0), loss(1));
  EXPECT_NE(as_seen, loss(1));

  TrainPolicy(Place("policy"), Quick(2), &codec, {});
  EXPECT_EQ(WeightFile(folder_ / "policy" / "policy.safetensors", kLearnedFormat).Text("codec"),
            train::CodecSha256(weights));
  const auto encode = [&](const std::string& as, const std::string& products) {
    for (const auto& shard : train::ShardPaths(folder_ / "shards")) {
      train::CheckpointWeights again(weights);
      train::EncodeShard(nn::Vae(nn::Scope(again, train::kCodecPrefix), LearningCodec()), shard,
                         {as, Sha256HexOfFile(shard), products});
    }
  };
  encode(train::CodecSha256(weights), "bfloat16");
  EXPECT_THAT([&] { TrainPolicy(Place("policy"), Quick(2), &codec, {}); },
              ThrowsMessage<TensorError>(HasSubstr("is a training with other options"))) << "latents made otherwise";
  encode("another", "float32");
  EXPECT_THAT([&] { TrainPolicy(Place("refused"), Quick(2), &codec, {}); },
              ThrowsMessage<TensorError>(HasSubstr("did not make the shards' latents")));
}

TEST_F(TrainPolicyTest, EachPackingsClipsAreKnownByItsOwnPage) {
  const LearningShards pushes{.clips = 8, .behaviour = "push"};
  WriteLearningShards(folder_ / "pushes", pushes);
  const PackedSet set({folder_ / "shards", folder_ / "pushes/"}, train::Split::kTrain);
  ASSERT_EQ(set.clips.size(), 24u + 8u);
  for (std::size_t i = 0; i < set.clips.size(); ++i) EXPECT_EQ(set.clips[i].behaviour, i < 24 ? "good" : "push") << i;
  PolicyOptions options = Quick(1);
  options.behaviours = "push";
  EXPECT_EQ(PolicyTraining(set, options, nullptr).clips(), 4u);
}

TEST_F(TrainPolicyTest, ACarriedCameraGoesWithTheToldGripperHoweverLateTheShardsAre) {
  const PackedSet set({folder_ / "shards"}, train::Split::kTrain);
  const train::Shard& shard = set.shards.shards().front();
  const std::int64_t first = set.clips.front().first, last = set.clips.front().frames - 1;
  const auto right_m = [&](std::int64_t row) {
    const auto xyz = shard.actions[first + row].narrow(0, 8, 3);
    return Eigen::Vector3d(xyz[0].item<double>(), xyz[1].item<double>(), xyz[2].item<double>());
  };
  const Eigen::Vector3d went_m = right_m(last) - right_m(0);
  ASSERT_GT(went_m.norm(), 0.05);  // the shards' c2w stands still
  const auto eye_m = [&](std::int64_t row, std::int64_t view, Mount mount) {
    return ToldCamera(shard, first, row, view, mount).translation().eval();
  };
  EXPECT_TRUE(eye_m(last, 0, Mount::kBase).isApprox(eye_m(0, 0, Mount::kBase), 1e-6));
  EXPECT_TRUE((eye_m(last, 1, Mount::kRightGripper) - eye_m(0, 1, Mount::kRightGripper)).isApprox(went_m, 1e-4));
}

}  // namespace
}  // namespace evac
