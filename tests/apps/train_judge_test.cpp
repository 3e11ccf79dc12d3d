#include "apps/networks/train_judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "apps/networks/judge_quality.h"
#include "apps/networks/judge_shard_clips.h"
#include "apps/networks/judge_tables.h"
#include "apps/networks/judge_widen.h"
#include "apps/networks/learners.h"
#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/weight_file.h"
#include "tests/apps/learning_shards.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/sha256.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

JudgeTrainingOptions Quick(std::int64_t steps) {
  JudgeTrainingOptions options;
  options.batch = 8;
  options.calibration = 0.3;
  options.job.trainer.steps = steps;
  options.job.trainer.learning_rate = 2e-3;
  options.job.trainer.clip_norm = 1;
  options.job.trainer.holdout_every = steps / 2;
  options.job.trainer.checkpoint_every_s = 0;
  options.job.trainer.seed = 3;
  return options;
}

class TrainJudgeTest : public testing::Test {
 protected:
  void SetUp() override { WriteLearningShards(folder_ / "shards", {}); }
  train::JobPlace Place(const std::string& out) const {
    train::JobPlace place;
    place.shards = {folder_ / "shards"};
    place.out = folder_ / out;
    return place;
  }
  train::TrainerSummary Train(const train::JobPlace& place, const JudgeTrainingOptions& options,
                              const ShardCodec* codec = nullptr, const std::filesystem::path& init = {}) const {
    const ShardClips learn({folder_ / "shards"}, train::Split::kTrain, codec),
        holdout({folder_ / "shards"}, train::Split::kHoldout, codec);
    return TrainJudge(place, options, {learn, holdout, init});
  }
  const TempFolder folder_;
};

TEST_F(TrainJudgeTest, ATinyClassifierTellsClipsApartThatItHasNotSeen) {
  train::JobPlace place = Place("judge");
  std::string said;
  place.say = [&](const std::string& line) { said += line + "\n"; };
  const train::TrainerSummary summary = Train(place, Quick(150));
  EXPECT_THAT(said, Not(HasSubstr("warning")));
  const WeightFile file(folder_ / "judge" / "judge.safetensors", "evac-classifier 1");
  EXPECT_EQ(file.Text("steps"), "150");
  EXPECT_EQ(file.Text("best_step"), std::to_string(summary.best_step));
  EXPECT_GT(file.Number("auroc"), 0.95);
  EXPECT_GT(file.Number("kappa"), 0.8);
  EXPECT_LE(file.Number("kappa_masked"), file.Number("kappa"));
  EXPECT_EQ(file.Text("tasks"), "carry");
  EXPECT_EQ(file.Text("recipe"), "carry");
  EXPECT_NO_THROW(ClassifierJudge(folder_ / "judge" / "judge.safetensors", folder_.path()));
}

/// It was trained to the end, and refused by each command that was to judge by it.
TEST_F(TrainJudgeTest, PicturesWhoseSidesAreNoMultiplesOfEightAreRefusedBeforeTheFirstStep) {
  for (const auto& [height_px, width_px] : {std::pair(20, 24), std::pair(16, 28)}) {
    WriteLearningShards(folder_ / "shards", {.clips = 8, .height_px = height_px, .width_px = width_px});
    const std::string found = std::to_string(width_px) + "x" + std::to_string(height_px);
    EXPECT_THAT([&] { Train(Place("judge"), Quick(2)); },
                ThrowsMessage<Error>(HasSubstr("pictures are " + found + ", wanted multiples of 8")));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "judge"));
  }
}

TEST_F(TrainJudgeTest, GoesOnFromAJudgeThatIsGiven) {
  Train(Place("first"), Quick(150));
  const std::filesystem::path first = folder_ / "first" / "judge.safetensors";
  JudgeTrainingOptions still = Quick(2);
  still.job.trainer.learning_rate = 1e-9;
  const auto kappa = [&](const char* out) {
    return WeightFile(folder_ / out / "judge.safetensors", "evac-classifier 1").Number("kappa");
  };
  Train(Place("second"), still, nullptr, first);
  EXPECT_NEAR(kappa("second"), kappa("first"), 0.1);
  Train(Place("fresh"), still);
  EXPECT_LT(kappa("fresh"), kappa("first") - 0.3) << "two steps teach nothing";
}

TEST_F(TrainJudgeTest, AClipSeenAsALongerOneStandsStillAtItsEnd) {
  PackedClip clip;
  clip.first = 100;
  clip.frames = 15;
  EXPECT_THAT(RowsOf(clip), ElementsAre(100, 102, 104, 106, 108, 110, 112, 114));
  EXPECT_THAT(RowsOf(clip, 2), ElementsAre(100, 104, 108, 112, 114, 114, 114, 114));
  EXPECT_THAT(RowsOf(clip, 50), ElementsAre(100, 114, 114, 114, 114, 114, 114, 114));
}

TEST_F(TrainJudgeTest, TrainedForLongerClipsItIsMeasuredOnThem) {
  JudgeTrainingOptions options = Quick(150);
  options.longest = 4;
  Train(Place("longer"), options);
  const WeightFile file(folder_ / "longer" / "judge.safetensors", "evac-classifier 1");
  EXPECT_EQ(file.Number("longer"), 2.5);
  EXPECT_EQ(file.Number("longest_frames"), 4 * LearningShards{}.frames);
  EXPECT_GT(file.Number("kappa"), 0.8);
  EXPECT_GT(file.Number("kappa_longer"), 0.8);

  const ShardClips set({folder_ / "shards"}, train::Split::kTrain, nullptr);
  const Learners<ClassifierNet> learners(ClassifierShape{set.tasks, set.cameras, 16, 24}, 3, 1);
  const auto loss = [&](double longest) {
    JudgeTrainingOptions some = Quick(1);
    some.longest = longest;
    return JudgeTraining(set, set.clips, some).Loss(learners.net(), {3, 0, 0, 0}).item<double>();
  };
  EXPECT_NE(loss(4), loss(1));
  EXPECT_THROW(loss(0.5), Error);
}

TEST_F(TrainJudgeTest, ItMayLookAtMorePlacesThanTheObject) {
  JudgeTrainingOptions options = Quick(150);
  options.looks = 3;
  Train(Place("looks"), options);
  const std::filesystem::path weights = folder_ / "looks" / "judge.safetensors";
  const WeightFile file(weights, "evac-classifier 1");
  EXPECT_EQ(file.Text("looks"), "3");
  EXPECT_GT(file.Number("kappa"), 0.8);
  EXPECT_NO_THROW(ClassifierJudge(weights, folder_.path()));

  EXPECT_THAT([&] { Train(Place("on"), Quick(2), nullptr, weights); },
              ThrowsMessage<Error>(HasSubstr("looks at 3 places, wanted at most 1")));
  options.looks = 0;
  EXPECT_THAT([&] { Train(Place("none"), options); }, ThrowsMessage<Error>(HasSubstr("looks is 0, wanted 1 … 16")));
}

TEST_F(TrainJudgeTest, AJudgeThatIsGivenMoreLooksBeginsAsItWas) {
  Train(Place("first"), Quick(20));   // longer, and logits reach 45, where floats are too coarse for the bound below
  const std::filesystem::path first = folder_ / "first" / "judge.safetensors", wide = folder_ / "wide.safetensors";
  const ShardClips set({folder_ / "shards"}, train::Split::kTrain, nullptr);
  const auto logits = [&](std::int64_t looks, const std::filesystem::path& weights) {
    const Learners<ClassifierNet> learners(ClassifierShape{set.tasks, set.cameras, 16, 24, looks}, 3, 1, weights);
    return Logits(learners.net(), set, set.clips, {});
  };
  WidenJudge(first, ClassifierShape{set.tasks, set.cameras, 16, 24, 3}, 3, wide);
  EXPECT_THAT(logits(3, wide), testing::Pointwise(testing::DoubleNear(1e-5), logits(1, first)));

  JudgeTrainingOptions more = Quick(4);
  more.looks = 3;
  Train(Place("more"), more, nullptr, first);
  EXPECT_EQ(WeightFile(folder_ / "more" / "judge.safetensors", "evac-classifier 1").Text("looks"), "3");
  EXPECT_NO_THROW(ClassifierJudge(folder_ / "more" / "judge.safetensors", folder_.path()));
}

TEST_F(TrainJudgeTest, OneThatLearnedNothingIsWarnedOf) {
  train::JobPlace place = Place("nothing");
  std::string said;
  place.say = [&](const std::string& line) { said += line + "\n"; };
  JudgeTrainingOptions options = Quick(2);
  options.job.trainer.learning_rate = 1e-9;
  Train(place, options);
  EXPECT_THAT(said, HasSubstr("warning: it learned too little for its verdicts to be counted"));
}

TEST_F(TrainJudgeTest, InterruptedAndGoneOnWithItEndsInTheSameBytes) {
  Train(Place("whole"), Quick(12));
  train::JobPlace place = Place("parts");
  int steps = 0;
  place.interrupted = [&] { return ++steps % 5 == 0; };
  int runs = 0;
  while (!Train(place, Quick(12)).IsDone()) ++runs;
  EXPECT_EQ(runs, 2);
  EXPECT_EQ(Sha256HexOfFile(folder_ / "parts" / "judge.safetensors"),
            Sha256HexOfFile(folder_ / "whole" / "judge.safetensors"));
}

class CodedJudgeTest : public TrainJudgeTest {
 protected:
  void SetUp() override {
    TrainJudgeTest::SetUp();
    codec_ = EncodeLearningShards(folder_ / "shards", folder_ / "codec");
  }
  const nn::VaeConfig config_ = LearningCodec();
  std::filesystem::path codec_;
};

TEST_F(CodedJudgeTest, ItLearnsFromClipsAsTheCodecGivesThemBackAndIsMeasuredOnThem) {
  const ShardCodec shard_codec(codec_, config_);
  const ShardClips set({folder_ / "shards"}, train::Split::kTrain, &shard_codec);
  const PackedClip& clip = set.clips[3];
  const std::vector<std::int64_t> rows = RowsOf(clip);
  const at::Tensor whole = set.Pictures(clip, rows).to(at::kFloat);
  const at::Tensor coded = set.Reconstructed(clip, rows).to(at::kFloat);
  ASSERT_EQ(coded.sizes(), whole.sizes());
  const double off = (coded - whole).abs().mean().item<double>();
  EXPECT_GT(off, 0.5) << "it is not the picture itself";
  EXPECT_LT(off, 0.5 * (whole.flip(0) - whole).abs().mean().item<double>() + 12) << "but like it, view by view";

  Train(Place("judge"), Quick(150), &shard_codec);
  const WeightFile file(folder_ / "judge" / "judge.safetensors", "evac-classifier 1");
  EXPECT_EQ(file.Text("codec"), train::CodecSha256(codec_));
  EXPECT_GT(file.Number("kappa"), 0.8);
  EXPECT_GT(file.Number("kappa_reconstructed"), 0.8);

  const std::string judged = ReadFile(folder_ / "judge" / "judged.csv");
  const ShardClips holdout({folder_ / "shards"}, train::Split::kHoldout, &shard_codec);
  const JudgeSplit split = SplitForJudge(set.clips, Quick(150));
  EXPECT_EQ(std::ranges::count(judged, '\n'), 1 + 2 * (holdout.clips.size() + split.calibration.size()))
      << "recorded and given back, none that was learned from";
  EXPECT_EQ(std::ranges::count(ReadFile(folder_ / "judge" / "thresholds.csv"), '\n'), 1 + 4 * 19);
}

TEST_F(CodedJudgeTest, LatentsOfAnotherCodecAreRefused) {
  for (const auto& shard : train::ShardPaths(folder_ / "shards")) {
    train::CheckpointWeights weights(codec_);
    train::EncodeShard(nn::Vae(nn::Scope(weights, train::kCodecPrefix), config_), shard, {"another", Sha256HexOfFile(shard)});
  }
  const ShardCodec shard_codec(codec_, config_);
  EXPECT_THAT([&] { Train(Place("judge"), Quick(2), &shard_codec); },
              ThrowsMessage<TensorError>(HasSubstr("did not make the shards' latents")));
}

TEST_F(CodedJudgeTest, ATrainingGoesOnOnlyWithLatentsThatWereMadeAlike) {
  const ShardCodec shard_codec(codec_, config_);
  Train(Place("judge"), Quick(2), &shard_codec);
  for (const auto& shard : train::ShardPaths(folder_ / "shards")) {
    train::CheckpointWeights weights(codec_);
    train::EncodeShard(nn::Vae(nn::Scope(weights, train::kCodecPrefix), config_), shard,
                       {train::CodecSha256(codec_), Sha256HexOfFile(shard), "bfloat16"});
  }
  EXPECT_THAT([&] { Train(Place("judge"), Quick(2), &shard_codec); },
              ThrowsMessage<TensorError>(HasSubstr("is a training with other options")));
}

TEST_F(CodedJudgeTest, AFileThatHoldsTheSameCodecAndMoreMadeTheSameLatents) {
  const TensorFile alone = TensorFile::Open(codec_);
  std::vector<TensorView> tensors = alone.tensors();
  const std::vector<std::byte> more(8);
  tensors.insert(tensors.begin(), TensorView{{"model.more", TensorType::kF32, {2}}, more});
  const std::filesystem::path whole = folder_ / "whole.safetensors", other = folder_ / "other.safetensors";
  WriteTensorFile(whole, tensors, {{"a_world", "model's card"}});
  train::ShardSet shards(folder_ / "shards", train::Split::kTrain);
  ShardCodec(whole, config_).Open(shards);
  EXPECT_EQ(train::CodecSha256(whole), train::CodecSha256(codec_));

  std::vector<std::byte> last(tensors.back().bytes.begin(), tensors.back().bytes.end());
  last[0] ^= std::byte{1};
  tensors.back().bytes = last;
  WriteTensorFile(other, tensors, {{"a_world", "model's card"}});
  EXPECT_THAT([&] { ShardCodec(other, config_).Open(shards); },
              ThrowsMessage<TensorError>(HasSubstr("did not make the shards' latents")));
}

TEST_F(CodedJudgeTest, TheSameNumbersInAnotherTypeAreTheSameCodec) {
  const nn::MappedTensors read(TensorFile::Open(codec_));
  std::vector<at::Tensor> halves, floats;
  std::vector<TensorView> of_halves, of_floats;
  for (const TensorView& tensor : read.file().tensors()) {
    halves.push_back(read.Get(tensor.name).to(at::kBFloat16));
    floats.push_back(halves.back().to(at::kFloat));
    of_halves.push_back(nn::ViewOf(tensor.name, halves.back()));
    of_floats.push_back(nn::ViewOf(tensor.name, floats.back()));
  }
  WriteTensorFile(folder_ / "halves.safetensors", of_halves, {});
  WriteTensorFile(folder_ / "floats.safetensors", of_floats, {});
  EXPECT_EQ(train::CodecSha256(folder_ / "halves.safetensors"), train::CodecSha256(folder_ / "floats.safetensors"));
  EXPECT_NE(train::CodecSha256(folder_ / "halves.safetensors"), train::CodecSha256(codec_)) << "rounded";
}

TEST_F(TrainJudgeTest, CalibrationSharesNoInitialStateWithLearning) {
  const ShardClips set({folder_ / "shards"}, train::Split::kTrain, nullptr);
  const JudgeSplit split = SplitForJudge(set.clips, Quick(2));
  EXPECT_EQ(split.fit.size() + split.calibration.size(), set.clips.size());
  for (const PackedClip& one : split.fit) {
    for (const PackedClip& other : split.calibration) EXPECT_NE(one.state, other.state);
  }
}

TEST_F(TrainJudgeTest, OutcomesOfOneKindAloneAreRefused) {
  ShardClips set({folder_ / "shards"}, train::Split::kTrain, nullptr);
  for (PackedClip& clip : set.clips) clip.outcome = 1;
  EXPECT_THAT([&] { SplitForJudge(set.clips, Quick(2)); },
              ThrowsMessage<Error>(HasSubstr("wanted some of both kinds")));
}

/// "0 of 0 clips to learn from are successes … more recordings", which would say as little.
TEST_F(TrainJudgeTest, ShardsThatSayNothingOfOutcomesAreRefusedAsSuch) {
  WriteLearningShards(folder_ / "shards", {.knows_outcome = false});
  EXPECT_THAT([&] { Train(Place("judge"), Quick(2)); },
              ThrowsMessage<Error>(HasSubstr((folder_ / "shards").string() +
                                             ": none of the 24 clips says whether it was a success, wanted shards of")));
}

TEST_F(TrainJudgeTest, APackingThatSaysNothingOfStatesIsRefused) {
  std::ofstream(folder_ / "shards" / "shards.json") << "{}";
  EXPECT_THAT([&] { Train(Place("judge"), Quick(2)); },
              ThrowsMessage<Error>(HasSubstr("wanted states, behaviours and fates per recording")));
}

TEST(Moved, TheObjectStaysWhereThePicturesShowIt) {
  at::Tensor pictures = at::zeros({2, 3, 8, 12, 3}, at::kByte);
  at::Tensor objects = at::zeros({2, 3, 2});
  const auto put = [&](std::int64_t view, std::int64_t time, std::int64_t x, std::int64_t y) {
    pictures[view][time][y][x].fill_(255);
    objects[view][time] = at::tensor({static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F});
  };
  for (std::int64_t time = 0; time < 3; ++time) put(0, time, 3 + time, 2), put(1, time, 6, 3 + time);
  for (const bool is_mirrored : {false, true}) {
    const SeenClip moved = Moved({pictures, objects}, {{2, -1}, {-3, 2}}, is_mirrored);
    for (std::int64_t view = 0; view < 2; ++view) {
      for (std::int64_t time = 0; time < 3; ++time) {
        const at::Tensor at = moved.objects[view][time].floor().to(at::kLong);
        EXPECT_EQ(moved.pictures[view][time][at[1].item<std::int64_t>()][at[0].item<std::int64_t>()][0].item<int>(),
                  255)
            << view << " " << time << (is_mirrored ? " mirrored" : "");
        EXPECT_EQ((moved.pictures[view][time] == 255).sum().item<int>(), 3) << "one pixel, three colours";
      }
    }
    const float left = is_mirrored ? 12 - 5.5F : 5.5F;
    EXPECT_EQ(moved.objects[0][0][0].item<float>(), left);
    EXPECT_EQ(moved.objects[0][0][1].item<float>(), 1.5F);
  }
}

/// They counted as 1, or as 0, and hours later nobody saw it.
TEST_F(TrainJudgeTest, OptionsOutOfRangeAreRefusedByName) {
  const std::pair<std::string, double> wrong[] = {
      {"drop_view", 50}, {"jitter", -0.1}, {"mirror_share", 2}, {"reconstructed_share", -1}, {"object_weight", -1},
      {"unsure", std::nan("")}, {"light", 2}, {"offset", -0.1}, {"blur_share", 25}, {"calibration", 1.5}};
  for (const auto& [name, value] : wrong) {
    JudgeTrainingOptions options = Quick(2);
    for (const train::Setting& setting : SettingsOf(options)) {
      if (setting.name == name) *std::get<double*>(setting.field) = value;
    }
    EXPECT_THAT([&] { Train(Place("wrong"), options); },
                ThrowsMessage<TensorError>(HasSubstr("judge training: " + name + " is "))) << name;
  }
}

/// No copy of the network was made, and the first of none was trained.
TEST_F(TrainJudgeTest, AStepOfNoPartsIsRefused) {
  JudgeTrainingOptions options = Quick(2);
  options.job.trainer.accumulate = 0;
  EXPECT_THAT([&] { Train(Place("judge"), options); },
              ThrowsMessage<TensorError>(HasSubstr("training: accumulate is 0")));
}

TEST_F(TrainJudgeTest, MovedAndMirroredClipsAreOtherClips) {
  const auto weights = [&](const std::string& out, std::int64_t shift_px, double mirror_share) {
    JudgeTrainingOptions options = Quick(2);
    options.shift_px = shift_px;
    options.mirror_share = mirror_share;
    Train(Place(out), options);
    return Sha256HexOfFile(folder_ / out / "judge.safetensors");
  };
  const std::string as_it_is = weights("as_it_is", 0, 0);
  EXPECT_EQ(weights("again", 0, 0), as_it_is);
  EXPECT_NE(weights("moved", 1, 0), as_it_is);
  EXPECT_NE(weights("mirrored", 0, 1), as_it_is);
  EXPECT_THAT([&] { weights("wrong", -1, 0); }, ThrowsMessage<Error>(HasSubstr("shift_px is -1, wanted at least 0")));
}

TEST(Calibrate, FindsTheTemperatureThatMadeTheLogitsTooSure) {
  JudgeClips clips;
  std::vector<double> logits;
  for (int i = 0; i < 400; ++i) {
    const double honest = (i % 40 - 19.5) / 8;  // log odds
    clips.emplace_back().outcome = (i / 40 + 0.5) / 10 < 1 / (1 + std::exp(-honest)) ? 1 : 0;
    logits.push_back(3 * honest);
  }
  const ClassifierCard card = Calibrate(logits, clips, 0.1);
  EXPECT_NEAR(card.temperature, 3, 0.4);
  EXPECT_NEAR(card.threshold, 0.5, 0.1);
  EXPECT_LT(Measure(logits, clips, card).ece, 0.06);
}

TEST_F(TrainJudgeTest, GoesOnFromAJudgeOfTheSameTasksAloneAndKeepsWhatItLearnedFrom) {
  Train(Place("first"), Quick(2));
  const std::filesystem::path first = folder_ / "first" / "judge.safetensors";
  const auto with = [&](const char* name, const char* key, const char* value) {
    const TensorFile file = TensorFile::Open(first);
    TensorMetadata card = file.metadata();
    card[key] = value;
    WriteTensorFile(folder_ / name, file.tensors(), card);
    return folder_ / name;
  };
  EXPECT_THAT([&] { Train(Place("other"), Quick(2), nullptr, with("other.safetensors", "tasks", "pour")); },
              ThrowsMessage<Error>(HasSubstr("tasks is 'pour', wanted 'carry'")));
  Train(Place("marked"), Quick(2), nullptr, with("marked.safetensors", "learned_from", "0123456789ab"));
  EXPECT_EQ(WeightFile(folder_ / "marked" / "judge.safetensors", "evac-classifier 1").Text("learned_from"), "0123456789ab");
}

TEST_F(TrainJudgeTest, GoesOnOnlyWithWhatItWasBegunWith) {
  train::JobPlace place = Place("judge");
  place.begun_with = " init one";
  Train(place, Quick(2));
  place.begun_with = " init another";
  EXPECT_THAT([&] { Train(place, Quick(2)); }, ThrowsMessage<TensorError>(HasSubstr("is a training with other options")));
}

TEST(Calibrate, AtTheThresholdBothErrorsAreEqualShares) {
  JudgeClips clips;
  std::vector<double> logits;
  const auto add = [&](int outcome, double logit) {
    clips.emplace_back().outcome = outcome;
    logits.push_back(logit);
  };
  // 100 failures of which 10 look like successes up to a point, 300 successes of which some look less sure: kappa is
  // highest where no success is lost.
  for (int i = 0; i < 90; ++i) add(0, -4);
  for (int i = 0; i < 10; ++i) add(0, 0.2 * i);
  for (int i = 0; i < 30; ++i) add(1, 0.05 * i);
  for (int i = 0; i < 270; ++i) add(1, 4);
  const ClassifierCard card = Calibrate(logits, clips, 0);
  double hallucinated = 0, missed = 0;
  for (std::size_t i = 0; i < clips.size(); ++i) {
    const bool is_called_success = CalibratedProbability(logits[i], card) >= card.threshold;
    hallucinated += clips[i].outcome == 0 && is_called_success;
    missed += clips[i].outcome == 1 && !is_called_success;
  }
  EXPECT_GT(hallucinated, 0);
  EXPECT_NEAR(hallucinated / 100, missed / 300, 0.011);
  EXPECT_GT(card.threshold, 0.5);
}

TEST_F(TrainJudgeTest, CalibratedAnewItKeepsItsWeights) {
  Train(Place("first"), Quick(150));
  const std::filesystem::path first = folder_ / "first" / "judge.safetensors";
  const ShardClips learn({folder_ / "shards"}, train::Split::kTrain, nullptr),
      holdout({folder_ / "shards"}, train::Split::kHoldout, nullptr);
  JudgeTrainingOptions options = Quick(1);
  options.unsure = 0.03;
  CalibrateJudge(Place("anew"), options, {learn, holdout, first});
  const std::filesystem::path anew = folder_ / "anew" / "judge.safetensors";
  EXPECT_EQ(WeightFile(anew, "evac-classifier 1").Number("unsure"), 0.03);
  EXPECT_GT(WeightFile(anew, "evac-classifier 1").Number("kappa"), 0.8);
  const TensorFile before = TensorFile::Open(first), after = TensorFile::Open(anew);
  ASSERT_EQ(before.tensors().size(), after.tensors().size());
  for (const TensorView& tensor : before.tensors())
    EXPECT_TRUE(std::ranges::equal(tensor.bytes, after.Get(tensor.name).bytes)) << tensor.name;
}

TEST(JudgeTables, TheCountsAreThoseOfTheThreshold) {
  JudgeClips clips(4);
  clips[0].outcome = clips[1].outcome = 1;
  clips[2].outcome = clips[3].outcome = 0;
  clips[3].state = "a,b";
  clips[3].fate = "drop";
  ClassifierCard card;
  card.temperature = 2;
  card.unsure = 0.1;
  // .881, .269; .731, .119
  const std::vector<JudgedClips> judged = {{"hold-out", "recorded", &clips, {4, -2, 2, -4}}};
  const std::string thresholds = ThresholdsCsv(judged, card);
  EXPECT_EQ(std::ranges::count(thresholds, '\n'), 20) << "a header, .05 to .95";
  EXPECT_THAT(thresholds, HasSubstr("hold-out,recorded,0.05,2,2,2,0,0.5000\n"));
  EXPECT_THAT(thresholds, HasSubstr("hold-out,recorded,0.25,2,1,2,0,0.7500\n"));
  EXPECT_THAT(thresholds, HasSubstr("hold-out,recorded,0.50,2,1,2,1,0.5000\n"));
  EXPECT_THAT(thresholds, HasSubstr("hold-out,recorded,0.75,2,0,2,1,0.7500\n"));
  EXPECT_THAT(thresholds, HasSubstr("hold-out,recorded,0.95,2,0,2,2,0.5000\n"));
  const std::string rows = JudgedCsv(judged, card, {"carry"});
  EXPECT_THAT(rows, HasSubstr("hold-out,recorded,carry,0,,,,1,0.8808,success\n"));
  EXPECT_THAT(rows, HasSubstr("hold-out,recorded,carry,0,\"a,b\",,drop,0,0.1192,failure\n"));
  card.threshold = 0.8;
  EXPECT_THAT(JudgedCsv(judged, card, {"carry"}), HasSubstr("0.7311,cannot_tell\n"));
}

}  // namespace
}  // namespace evac
