#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>

#include "core/hash.h"
#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/prepared_world.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/train_forecast.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

/// What a training is begun with.
namespace evac::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

nn::ModelConfig Config(bool object_forecast) {
  nn::ModelConfig config = nn::TinyConfig();
  config.vae.channel_mult = {1, 1, 1};
  config.vae.scale_factor = 1;
  config.unet.channel_mult = {1, 1};
  config.schedule.from_last_frame = true;
  config.schedule.carry_plane_m = 0;
  config.unet.in_channels += config.vae.z_channels + 1;
  config.object_forecast = object_forecast;
  config.unet.in_channels += object_forecast ? 1 : 0;
  return config;
}

/// The image encoder sees the oldest memory frame, as when imagining.
WorldOptions ShownTheFirst(std::int64_t steps) {
  WorldOptions options = Quick(steps);
  options.world.windows.first_image = true;
  return options;
}

class WorldStartTest : public testing::Test {
 protected:
  WorldStartTest() {
    WriteSyntheticShards(folder_ / "shards", {});
    TrainCodec(Place("codec"), QuickCodec(1));
    CheckpointWeights weights(Codec());
    EncodeSyntheticShards(nn::Vae(nn::Scope(weights, kCodecPrefix), Config(true).vae), folder_ / "shards");
  }

  static CodecOptions QuickCodec(std::int64_t steps) {
    CodecOptions options;
    options.job.trainer.steps = steps;
    options.job.holdout_size = 4;
    options.codec.batch = 2;
    return options;
  }
  static ForecastOptions QuickForecast(std::int64_t steps) {
    ForecastOptions options;
    options.job.trainer.steps = steps;
    options.forecast.batch = 2;
    return options;
  }
  JobPlace Place(const std::string& out, bool object_forecast = true) const {
    return {{folder_ / "shards"}, folder_ / out, Config(object_forecast)};
  }
  std::filesystem::path Codec() const { return folder_ / "codec" / "codec.safetensors"; }
  std::filesystem::path Forecast() const {
    if (!std::filesystem::exists(folder_ / "forecast" / "forecast.safetensors"))
      TrainForecast(Place("forecast"), QuickForecast(1));
    return folder_ / "forecast" / "forecast.safetensors";
  }
  std::filesystem::path Weights(const std::string& out) const { return folder_ / out / "weights.safetensors"; }
  static std::string Train(const JobPlace& place, const WorldStart& start) {
    return TrainWorld(place, ShownTheFirst(1), start, {}).why;
  }

  const TempFolder folder_;
};

TEST_F(WorldStartTest, AForecastIsGivenWhereThePageHasOneAndNowhereElse) {
  WorldStart start{Codec()};
  const auto train = [&] { return Train(Place("refused"), start); };
  const auto none_given =
      ThrowsMessage<TensorError>(HasSubstr("object_forecast: true and no forecast is given: wanted --forecast"));
  EXPECT_THAT(train, none_given);
  start.forecast = Forecast();
  EXPECT_EQ(Train(Place("world"), start), "done");
  EXPECT_THAT([&] { Train(Place("plain", false), start); },
              ThrowsMessage<TensorError>(HasSubstr("object_forecast: false, wanted true, or no --forecast")));

  start.forecast.clear();
  EXPECT_EQ(Train(Place("plain", false), start), "done");
  start.init = Weights("plain");
  EXPECT_THAT(train, none_given) << "it holds none";
  start.init = Weights("world");
  EXPECT_EQ(Train(Place("again"), start), "done");
  start.init_except = {"object_"};
  EXPECT_THAT(train, none_given) << "it would be drawn anew, and stay so";
}

/// It was taken: turns are counted in frames and views told apart by their order, so it said where hands are not.
TEST_F(WorldStartTest, AForecastOfOtherCamerasIsRefused) {
  const std::filesystem::path other = folder_ / "other.safetensors";
  {
    const TensorFile file = TensorFile::Open(Forecast());
    EXPECT_EQ(file.metadata().at("period_s"), "0.1");
    TensorMetadata metadata = file.metadata();
    metadata["cameras"] = "hand_right,head";
    WriteTensorFile(other, file.tensors(), metadata);
  }
  WorldStart start{.codec = Codec()};
  start.forecast = other;
  EXPECT_THAT([&] { Train(Place("refused"), start); },
              ThrowsMessage<TensorError>(HasSubstr("other.safetensors: the forecast was trained for cameras 'hand_right,head'")));
}

TEST_F(WorldStartTest, AnExceptionThatBeginsNoKeyIsRefused) {
  ASSERT_EQ(Train(Place("plain", false), {.codec = Codec()}), "done");
  WorldStart start{.codec = Codec(), .init = Weights("plain")};
  const auto train = [&] { Train(Place("out", false), start); };
  for (const char* prefix : {"model.difusion_model.", "first_stage_model", "object_forecast"}) {
    start.init_except = {"model.diffusion_model.out.", prefix};
    EXPECT_THAT(train, ThrowsMessage<TensorError>(
                           HasSubstr("--init-except '" + std::string(prefix) + "' begins no key that --init gives")));
  }
  start.init_except = {"model.diffusion_model.out."};
  EXPECT_NO_THROW(CheckStart(Config(false), start));
}

/// Weights of a network that is told frame by frame were taken by one that is not, and no word said.
TEST_F(WorldStartTest, KeysThatThePageHasNoUseForAreRefusedByName) {
  JobPlace told = Place("told", false);
  told.config.unet.frame_actions = true;
  ASSERT_EQ(Train(told, {.codec = Codec()}), "done");
  WorldStart start{.codec = Codec(), .init = Weights("told")};
  const auto train = [&] { Train(Place("untold", false), start); };
  const auto refused = ThrowsMessage<TensorError>(
      AllOf(HasSubstr("does not fit the page of sizes"), HasSubstr("keys are not the network's"),
            HasSubstr("model.diffusion_model.frame_action_embedding.")));
  EXPECT_THAT(train, refused);
  start.init_widen = true;
  EXPECT_THAT(train, refused) << "it is shown more, not less";
  start.init_widen = false;
  start.init_except = {"model.diffusion_model.frame_action_embedding."};
  EXPECT_EQ(Train(Place("untold", false), start), "done") << "left behind where it is named";
  start.init = Weights("untold");
  EXPECT_THAT([&] { Train(Place("again", false), start); }, ThrowsMessage<TensorError>(HasSubstr("begins no key")));
}

TEST_F(WorldStartTest, AnObjectForecastThatThePageLacksIsRefused) {
  WorldStart start{Codec()};
  start.forecast = Forecast();
  ASSERT_EQ(Train(Place("world"), start), "done");
  start = {.codec = Codec(), .init = Weights("world")};
  EXPECT_THAT([&] { Train(Place("plain", false), start); },
              ThrowsMessage<TensorError>(HasSubstr("its model has an object_forecast, wanted object_forecast: true")));
}

TEST_F(WorldStartTest, WeightsThatLearnedFromAnotherNoiseAreRefused) {
  ASSERT_EQ(Train(Place("plain", false), {.codec = Codec()}), "done");
  WorldStart start{.codec = Codec(), .init = Weights("plain")};
  JobPlace other = Place("other", false);
  other.config.schedule.linear_end *= 2;
  EXPECT_THAT([&] { Train(other, start); },
              ThrowsMessage<TensorError>(HasSubstr("the schedule is another than the configuration's")));
  start.init_except = {"alphas_cumprod"};
  EXPECT_EQ(Train(other, start), "done") << "where it is meant";
}

/// Only heads of attention were compared: what the answer is counted from and what latents are scaled by were another
/// network's, and no word said.
TEST_F(WorldStartTest, WeightsThatMeanSomethingElseThanThePageSaysAreRefused) {
  JobPlace plain = Place("plain", false);
  plain.config.schedule.carry_plane_m.reset();  // which wants from_last_frame
  plain.config.unet.in_channels -= plain.config.vae.z_channels + 1;
  ASSERT_EQ(Train(plain, {.codec = Codec()}), "done");
  WorldStart start{.codec = Codec(), .init = Weights("plain")};
  nn::ModelConfig page = plain.config;
  const auto check = [&] { CheckStart(page, start); };
  const auto refused = [](const std::string& why) {
    return ThrowsMessage<TensorError>(HasSubstr("was trained with " + why));
  };
  EXPECT_NO_THROW(check());
  page.vae.scale_factor = 2;
  EXPECT_THAT(check, refused("vae.scale_factor 1, the page of sizes says 2"));
  page = plain.config;
  page.schedule.from_last_frame = false;
  EXPECT_THAT(check, refused("schedule.from_last_frame true, the page of sizes says false"));
  start.init_except = {"model.diffusion_model.out."};
  EXPECT_NO_THROW(check()) << "its answer is learned anew";
  ASSERT_EQ(Train(Place("carried", false), {.codec = Codec()}), "done");
  start = {.codec = Codec(), .init = Weights("carried")};
  page = Config(false);
  page.schedule.carry_plane_m = 0.75;
  EXPECT_NO_THROW(check()) << "another robot's table";
  start.init_widen = true;
  EXPECT_THAT(check, refused("schedule.carry_plane_m 0, the page of sizes says 0.75")) << "it would begin as another";
}

/// Its card says the plane among the sizes, where a forecast's own file has it by itself: it was not looked at.
TEST_F(WorldStartTest, AForecastOfAnotherPlaneInsideTheFirstWeightsIsRefused) {
  WorldStart start{.codec = Codec()};
  start.forecast = Forecast();
  ASSERT_EQ(Train(Place("world"), start), "done");
  start.init = Weights("world");
  nn::ModelConfig page = Config(true);
  page.schedule.carry_plane_m = 0.75;
  EXPECT_NO_THROW(CheckStart(page, start)) << "another gives the forecast";
  start.forecast.clear();
  EXPECT_THAT([&] { CheckStart(page, start); },
              ThrowsMessage<TensorError>(HasSubstr("schedule.carry_plane_m 0, the page of sizes says 0.75")));
}

TEST_F(WorldStartTest, StripStepsThatNoSamplerTakesAreRefusedBeforeAnythingIsWritten) {
  for (const std::int64_t steps : {0, 1, 1001}) {
    WorldOptions options = ShownTheFirst(1);
    options.strip_steps = steps;
    EXPECT_THAT([&] { TrainWorld(Place("out", false), options, {.codec = Codec()}, {}); },
                ThrowsMessage<TensorError>(HasSubstr("strip_steps is " + std::to_string(steps) + ", wanted 2 to 1000")));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  }
}

TEST_F(WorldStartTest, TheCardSaysOfWhichStepTheWeightsAre) {
  const auto card = [&](std::int64_t holdout_every) {
    const std::string out = "every " + std::to_string(holdout_every);
    WorldOptions options = ShownTheFirst(2);
    options.job.trainer.holdout_every = holdout_every;
    const TrainerSummary summary = TrainWorld(Place(out, false), options, {.codec = Codec()}, {});
    return std::pair(summary.best_step, TensorFile::Open(Weights(out)).metadata());
  };
  const auto [best_step, measured] = card(1);
  EXPECT_EQ(measured.at("best_step"), std::to_string(best_step));
  EXPECT_EQ(measured.at("steps"), "2");
  EXPECT_FALSE(card(0).second.contains("best_step")) << "none was measured";
}

TEST_F(WorldStartTest, TheHoldoutsLatentsAreOfTheSameCodec) {
  CheckpointWeights weights(Codec());
  const nn::Vae vae(nn::Scope(weights, kCodecPrefix), Config(true).vae);
  const std::filesystem::path holdout = ShardPaths(folder_ / "shards").at(1);
  EncodeShard(vae, holdout, {"another", Sha256HexOfFile(holdout)});
  EXPECT_THAT([&] { Train(Place("out", false), {.codec = Codec()}); },
              ThrowsMessage<TensorError>(
                  HasSubstr("the hold-out's latents are of codec another, those to learn from of codec codec")));
}

TEST_F(WorldStartTest, WhatIsNewBesideAForecastCountsNothingAtFirst) {
  const auto end = [&](const char* out, const nn::ModelConfig& config, double rate, const WorldStart& start) {
    WorldOptions options = ShownTheFirst(rate > 1e-9 ? 20 : 1);
    options.job.trainer.learning_rate = rate;
    options.job.trainer.holdout_every = options.job.trainer.steps;
    return TrainWorld({{folder_ / "shards"}, folder_ / out, config}, options, start, {}).best.value();
  };
  WorldStart start{Codec()};
  start.forecast = Forecast();
  const double before = end("first", Config(true), 3e-3, start);
  start = {.codec = Codec(), .init = Weights("first"), .init_widen = true};
  nn::ModelConfig more = Config(true);
  more.schedule.carry_first = true;
  more.unet.in_channels += more.vae.z_channels + 1;
  EXPECT_NEAR(end("widened", more, 1e-12, start), before, 1e-5 * before);

  nn::ModelConfig other = more;
  other.object_forecast = false;
  other.unet.in_channels -= 1;
  EXPECT_THAT([&] { end("other", other, 1e-12, start); },
              ThrowsMessage<TensorError>(HasSubstr("its model has an object_forecast, wanted object_forecast: true")));
}

TEST(WidenedWeights, NewColumnsComeBeforeThatOfTheObject) {
  const TempFolder folder;
  const std::string key = "model.diffusion_model.input_blocks.0.0.weight";
  const auto widened = [&](bool has_forecast) {
    const Tensor first = at::tensor({1.0F, 2.0F, 3.0F}).reshape({1, 3, 1, 1}), bias = at::zeros({1});
    std::vector<TensorView> views = {nn::ViewOf(key, first)};
    if (has_forecast) views.push_back(nn::ViewOf("object_forecast.eye.bias", bias));
    WriteTensorFile(folder / "weights.safetensors", views, {});
    return WidenedWeights(folder / "weights.safetensors", true).Take(key, {1, 5, 1, 1}).flatten();
  };
  EXPECT_TRUE(at::equal(widened(true), at::tensor({1.0F, 2.0F, 0.0F, 0.0F, 3.0F})));
  EXPECT_TRUE(at::equal(widened(false), at::tensor({1.0F, 2.0F, 3.0F, 0.0F, 0.0F}))) << "the object is new too";
}

TEST_F(WorldStartTest, ATrainingGoesOnOnlyWithWhatItWasBegunWithAndAsManyThreads) {
  const std::filesystem::path forecast = Forecast();
  const std::map<std::string, std::function<std::string(const JobPlace&, std::int64_t parts)>> trainings = {
      {"a codec",
       [&](const JobPlace& place, std::int64_t parts) {
         CodecOptions options = QuickCodec(3);
         options.job.trainer.accumulate = parts;
         return TrainCodec(place, options).why;
       }},
      {"a forecast",
       [&](const JobPlace& place, std::int64_t parts) {
         ForecastOptions options = QuickForecast(3);
         options.job.trainer.accumulate = parts;
         return TrainForecast(place, options).why;
       }},
      {"a world", [&](const JobPlace& place, std::int64_t parts) {
         WorldOptions options = ShownTheFirst(3);
         options.job.trainer.accumulate = parts;
         WorldStart start{Codec()};
         start.forecast = forecast;
         return TrainWorld(place, options, start, {}).why;
       }}};
  const auto refused = ThrowsMessage<TensorError>(HasSubstr("is a training with other options"));
  for (const auto& [name, train] : trainings) {
    SCOPED_TRACE(name);
    int left = 1;
    JobPlace place = Place("one part of " + name);
    place.interrupted = [&] { return left-- == 0; };
    place.begun_with = " page a";
    EXPECT_EQ(train(place, 1), "interrupted");
    left = 100;
    JobPlace other = place;
    other.begun_with = " page b";
    EXPECT_THAT([&] { train(other, 1); }, refused);
    other = place;
    other.threads = 2;
    EXPECT_THAT([&] { train(other, 1); }, refused) << "libtorch's own";
    EXPECT_EQ(train(place, 1), "done");

    left = 1;
    place = Place("two parts of " + name);
    place.interrupted = [&] { return left-- == 0; };
    place.threads = 2;
    EXPECT_EQ(train(place, 2), "interrupted");
    left = 100;
    place.threads = 5;
    EXPECT_EQ(train(place, 2), "done") << "no more than two work";
  }
}

/// Eight parts of a step were eight whole models on one GPU, and the eighth did not fit.
TEST(JobPlace, OnAGpuThePartsOfAStepFollowOneAnother) {
  JobOptions options;
  options.trainer.accumulate = 8;
  JobPlace place;
  place.threads = 16;
  EXPECT_EQ(Workers(place, options), 8);
  place.device = at::kCUDA;
  EXPECT_EQ(Workers(place, options), 1);
}

/// `evac train --device cuda` began what `evac-train --device cuda` refused to go on with: "cuda:0" is another text.
TEST(JobPlace, ATrainingOnAGpuGoesOnOnAnyOtherWithAnyThreads) {
  JobPlace place;
  place.threads = 16;
  place.begun_with = " page a";
  JobOptions whole, parts;
  parts.trainer.accumulate = 4;
  EXPECT_EQ(IdentityOf(place, whole), " workers 1 threads 16 page a") << "what trainings on a CPU go on by";
  EXPECT_EQ(IdentityOf(place, parts), " workers 4 page a");
  const std::string on_cpu = IdentityOf(place, whole);
  place.device = at::kCUDA;
  const std::string on_gpu = IdentityOf(place, whole);
  EXPECT_NE(on_gpu, on_cpu);
  place.threads = 3;
  for (const int index : {0, 1}) {
    place.device = at::Device(at::kCUDA, static_cast<at::DeviceIndex>(index));
    EXPECT_EQ(IdentityOf(place, whole), on_gpu) << index;
    EXPECT_EQ(IdentityOf(place, parts), on_gpu) << index << ": their number is an option's to say";
  }
}

TEST_F(WorldStartTest, AHoldoutOfNothingIsRefused) {
  const auto refused = ThrowsMessage<TensorError>(HasSubstr("holdout_size is 0, wanted at least 1"));
  WorldOptions world = ShownTheFirst(1);
  world.job.holdout_size = 0;
  EXPECT_THAT([&] { TrainWorld(Place("world", false), world, {.codec = Codec()}, {}); }, refused);
  CodecOptions codec = QuickCodec(1);
  codec.job.holdout_size = 0;
  EXPECT_THAT([&] { TrainCodec(Place("none"), codec); }, refused);
}

/// The one inside a whole model was not looked at: it looked into the wrong view, and the denoiser learned from its maps.
TEST_F(WorldStartTest, AForecastOfOtherCamerasInsideTheFirstWeightsIsRefusedToo) {
  WorldStart start{.codec = Codec()};
  start.forecast = Forecast();
  ASSERT_EQ(Train(Place("world"), start), "done");
  const std::filesystem::path other = folder_ / "other.safetensors";
  {
    const TensorFile file = TensorFile::Open(Weights("world"));
    TensorMetadata metadata = file.metadata();
    metadata["cameras"] = "hand_right,head";
    WriteTensorFile(other, file.tensors(), metadata);
  }
  start.forecast.clear();
  start.init = other;
  EXPECT_THAT([&] { Train(Place("refused"), start); },
              ThrowsMessage<TensorError>(HasSubstr("other.safetensors: the forecast was trained for cameras 'hand_right,head'")));
}

TEST_F(WorldStartTest, AForecastIsNotDrawnAnewInPart) {
  WorldStart start{.codec = Codec()};
  start.forecast = Forecast();
  ASSERT_EQ(Train(Place("world"), start), "done");
  start = {.codec = Codec(), .init = Weights("world"), .init_except = {"object_forecast.ends"}};
  EXPECT_THAT([&] { Train(Place("again"), start); },
              ThrowsMessage<TensorError>(HasSubstr("object_forecast: true and no forecast is given: wanted --forecast")));
}

/// Fingertips were read 23 cm off, and the card said the shards' words.
TEST_F(WorldStartTest, AForecastIsNotTrainedWithAnotherToolThanTheMapsWereDrawnWith) {
  JobPlace place = Place("forecast");
  place.config.pose_map.tool_length_m = 0;
  EXPECT_THAT([&] { TrainForecast(place, QuickForecast(1)); },
              ThrowsMessage<TensorError>(HasSubstr("the page's pose_map wants 'radius_px=50 thickness_px=8 tool_length_m=0'")));
}

TEST_F(WorldStartTest, AForecastOfAnotherPlaneIsRefused) {
  WorldStart start{.codec = Codec()};
  start.forecast = Forecast();
  JobPlace place = Place("refused");
  place.config.schedule.carry_plane_m = 0.75;
  EXPECT_THAT([&] { Train(place, start); },
              ThrowsMessage<TensorError>(HasSubstr("the forecast was trained for carry_plane_m '0', wanted '0.75'")));
}

/// The best step was chosen on recordings that meant something else.
TEST_F(WorldStartTest, AHoldoutOfOtherRecordingsThanThoseToLearnFromIsRefused) {
  const std::filesystem::path shard = folder_ / "shards" / "shard_00001.safetensors";  // the hold-out
  const TensorFile file = TensorFile::Open(shard);
  TensorMetadata metadata = file.metadata();
  metadata["period_s"] = "0.2";
  WriteTensorFile(folder_ / "changed", file.tensors(), metadata);
  std::filesystem::rename(folder_ / "changed", shard);
  EXPECT_THAT([&] { TrainCodec(Place("codec2"), QuickCodec(1)); },
              ThrowsMessage<TensorError>(AllOf(HasSubstr("shard_00001.safetensors: period_s differs from that of"),
                                               HasSubstr("shard_00000.safetensors"))));
}

}  // namespace
}  // namespace evac::train
