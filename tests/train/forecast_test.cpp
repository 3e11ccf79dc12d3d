#include <ATen/ops/equal.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/train_forecast.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

nn::ModelConfig ForecastConfig(std::int64_t views) {
  nn::ModelConfig config = nn::TinyConfig();
  config.vae.channel_mult = {1, 1, 1};
  config.vae.patch_px = 1;
  config.vae.scale_factor = 1;
  config.unet.channel_mult = {1, 1};
  config.views = views;
  config.object_forecast = true;
  config.unet.in_channels += 1;
  return config;
}

ForecastOptions Quick(std::int64_t steps) {
  ForecastOptions options;
  options.job.trainer.steps = steps;
  options.job.trainer.learning_rate = 2e-3;
  options.job.trainer.clip_norm = 1;
  options.forecast.batch = 8;
  options.forecast.frames = 3;
  options.forecast.late_start = 0.9;
  return options;
}

double Written(const std::filesystem::path& out, const char* what) {
  return std::stod(CheckpointWeights(out / "forecast.safetensors").file().metadata().at(what));
}

TEST(TrainForecast, FindsThingsInPicturesThatItHasNotSeen) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {.clips = 12, .failures = 6, .views = 2});
  const auto off_px = [&](const char* out, std::int64_t steps) {
    EXPECT_EQ(TrainForecast({{folder / "shards"}, folder / out, ForecastConfig(2)}, Quick(steps)).why, "done");
    return Written(folder / out, "finder_px");
  };
  ForecastOptions measured = Quick(2);
  measured.job.trainer.holdout_every = 1;
  const TrainerSummary summary = TrainForecast({{folder / "shards"}, folder / "measured", ForecastConfig(2)}, measured);
  EXPECT_EQ(Written(folder / "measured", "steps"), 2);
  EXPECT_EQ(Written(folder / "measured", "best_step"), summary.best_step);
  const double before = off_px("begun", 1), after = off_px("trained", 120);
  EXPECT_LT(after, 1.5) << before;
  EXPECT_GT(before, 2 * after);
}

TEST(EndThatCame, IsTheOneThatSaysWhereTheThingWasAndTheLikeliestWhereNobodyKnows) {
  const nn::ModelConfig config = ForecastConfig(2);
  const std::int64_t w = config.LatentWidth(), cells = w * config.LatentHeight() + 1, ends = nn::ObjectForecast::kEnds;
  nn::ObjectForecast::Answer answer;
  answer.ends = at::zeros({2, 1, ends});
  answer.ends.select(2, 2).fill_(1);  // the likeliest by itself
  answer.places = at::zeros({4, 1, ends, cells});
  answer.places.select(2, 0).select(2, 0).fill_(9);      // at the first place in both views
  answer.places.select(2, 1).select(2, w + 1).fill_(9);  // a row and a column on
  Tensor place = at::full({4, 1, 2}, std::nan(""), at::kFloat);
  place.narrow(0, 0, 2).fill_(1);
  EXPECT_TRUE(at::equal(EndThatCame(answer, place, config).flatten(), at::tensor({1, 2})));
  place[1].fill_(std::nan(""));  // seen by one of two cameras, as the same end says now
  answer.places[1][0][1][cells - 1].fill_(20);
  EXPECT_EQ(EndThatCame(answer, place, config)[0].item<std::int64_t>(), 1);
  place.narrow(0, 0, 2).fill_(0);
  EXPECT_EQ(EndThatCame(answer, place, config)[0].item<std::int64_t>(), 0);
}

TEST(TrainForecast, EndsInTheSameBytesWhenItWasKilled) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {.failures = 3});
  ForecastOptions options = Quick(6);
  options.job.trainer.accumulate = 2;
  options.job.trainer.checkpoint_every_s = 0;
  const auto weights = [&](const char* out) {
    nn::MappedTensors tensors(TensorFile::Open(folder / out / "forecast.safetensors"));
    return tensors.Get("object_forecast.hand.weight").clone();
  };
  TrainForecast({{folder / "shards"}, folder / "whole", ForecastConfig(1), 2}, options);
  int asked = 0;
  JobPlace killed{{folder / "shards"}, folder / "killed", ForecastConfig(1), 2};
  killed.interrupted = [&] { return ++asked == 3; };
  EXPECT_EQ(TrainForecast(killed, options).why, "interrupted");
  EXPECT_FALSE(std::filesystem::exists(folder / "killed" / "forecast.safetensors"));
  EXPECT_EQ(TrainForecast(killed, options).why, "done");
  EXPECT_TRUE(at::equal(weights("whole"), weights("killed")));
}

/// A file of variants: of each of a shard's clips one, told the same, of that outcome.
void WriteVariantsOf(const std::filesystem::path& shard, std::int8_t outcome, TensorMetadata metadata,
                     std::int64_t of = 0) {
  nn::MappedTensors file(TensorFile::Open(shard));
  const Tensor start = file.Get("clip_start"), clip = at::arange(start.size(0) - 1) + of,
               outcomes = at::full({clip.size(0)}, outcome, at::kChar), actions = file.Get("actions"),
               places = file.Get("object_px");
  const TensorView views[] = {nn::ViewOf("clip", clip), nn::ViewOf("start", start), nn::ViewOf("actions", actions),
                              nn::ViewOf("object_px", places), nn::ViewOf("outcome", outcomes)};
  metadata.merge(TensorMetadata{{"format", "evac-variants"}, {"version", "1"}});
  WriteTensorFile(VariantsPath(shard), views, metadata);
}

/// Of the training shard.
void WriteVariants(const std::filesystem::path& shards, std::int8_t outcome, const std::string& recipe,
                   std::int64_t of = 0) {
  WriteVariantsOf(shards / "shard_00000.safetensors", outcome, {{"recipe", recipe}}, of);
}

std::string RecipeOf(const std::filesystem::path& shards) {
  return TensorFile::Open(shards / "shard_00000.safetensors").metadata().at("recipe");
}

TEST(TrainForecast, BelievesInSuccessLessTheMoreOftenFailuresAreDrawn) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {.failures = 3});  // told alike: half of them succeed
  const auto believed = [&](const char* out, double weight) {
    ForecastOptions options = Quick(60);
    options.forecast.failure_weight = weight;
    TrainForecast({{folder / "shards"}, folder / out, ForecastConfig(1)}, options);
    nn::MappedTensors tensors(TensorFile::Open(folder / out / "forecast.safetensors"));
    return tensors.Get("object_forecast.success.bias").to(at::kFloat).mean().item<double>();
  };
  EXPECT_LT(believed("failures", 8), believed("alike", 1));
}

TEST(TrainForecast, LearnsFromVariantsAsOftenAsIsAsked) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});  // all succeed
  WriteVariants(folder / "shards", 0, RecipeOf(folder / "shards"));
  const auto agreement = [&](const char* out, double share) {
    ForecastOptions options = Quick(40);
    options.forecast.variant_share = share;
    EXPECT_EQ(TrainForecast({{folder / "shards"}, folder / out, ForecastConfig(1)}, options).why, "done");
    return Written(folder / out, "agreement");
  };
  EXPECT_EQ(agreement("clips", 0), 1);
  EXPECT_EQ(agreement("variants", 1), 0) << "told the same, all variants fail";
}

TEST(TrainForecast, DoesNotGoOnWithOtherVariants) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  const std::string recipe = RecipeOf(folder / "shards");
  int left = 0;
  JobPlace place{{folder / "shards"}, folder / "out", ForecastConfig(1)};
  place.interrupted = [&] { return left-- == 0; };
  const auto go_on = [&](int steps, std::int8_t outcome) {
    WriteVariants(folder / "shards", outcome, recipe);
    left = steps;
    return TrainForecast(place, Quick(6)).why;
  };
  EXPECT_EQ(go_on(2, 0), "interrupted");
  EXPECT_THAT([&] { go_on(2, 1); }, ThrowsMessage<TensorError>(HasSubstr("is a training with other options")))
      << "as many, that ended otherwise";
  EXPECT_EQ(go_on(100, 0), "done");
}

/// The mean loss of some steps of shards, untrained.
double LossOf(const std::filesystem::path& folder, const ForecastTrainingOptions& options) {
  const nn::ModelConfig config = ForecastConfig(1);
  const ShardSet shards(folder, Split::kTrain);
  nn::RandomWeights random(1);
  const nn::ObjectForecast forecast(nn::Scope(random, nn::kForecastPrefix), config);
  const ForecastTraining training(shards, config, options);
  const at::NoGradGuard no_gradients;
  double sum = training.Measure(forecast).loss;
  for (std::int64_t step = 0; step < 4; ++step) sum += training.Loss(forecast, {1, step, 0, 0}).item<double>();
  return sum / 5;
}

TEST(ForecastTraining, WhatIsInfinitelyFarAwayIsNotSeenAndNoReasonForALossThatIsNone) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {.failures = 3});
  for (const double far : {HUGE_VAL, -HUGE_VAL, 1e30}) {
    ChangeSyntheticShard(folder / "shards", [&](const std::string& name, Tensor& tensor) {
      if (name == "object_px") tensor.narrow(0, 0, 3 * 9).fill_(far);  // three clips of six
    });
    EXPECT_TRUE(std::isfinite(LossOf(folder / "shards", Quick(1).forecast))) << far;
  }
}

TEST(ForecastTraining, SuccessesAloneAreDrawnHoweverMuchFailuresCount) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  for (const double weight : {1e300, HUGE_VAL}) {
    ForecastTrainingOptions options = Quick(1).forecast;
    options.batch = 2;
    options.failure_weight = weight;
    EXPECT_TRUE(std::isfinite(LossOf(folder / "shards", options))) << weight;
  }
}

TEST(Variants, WithAnOutcomeThatIsNoneAreRefused) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  WriteVariants(folder / "shards", 2, RecipeOf(folder / "shards"));
  EXPECT_THAT([&] { ShardSet(folder / "shards", Split::kTrain).OpenVariants(); },
              ThrowsMessage<TensorError>(HasSubstr("variant 0 has outcome 2, wanted 1 for success")));
}

TEST(Variants, OfOtherShardsOrOfClipsThatAreNotThereAreRefused) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  const auto opened = [&] {
    ShardSet set(folder / "shards", Split::kTrain);
    set.OpenVariants();
    return set.variants().size();
  };
  EXPECT_EQ(opened(), 0u) << "none need be there";
  const std::string recipe = RecipeOf(folder / "shards");
  WriteVariants(folder / "shards", 1, recipe);
  EXPECT_EQ(opened(), 6u);
  WriteVariants(folder / "shards", 1, "another");
  EXPECT_THAT(opened, ThrowsMessage<TensorError>(HasSubstr("recipe is 'another'")));
  WriteVariants(folder / "shards", 1, recipe, 1);
  EXPECT_THAT(opened, ThrowsMessage<TensorError>(HasSubstr("variant 5 is of clip 6 of 6")));
}

/// `evac vary` with another seed, killed half way, left a mixture, and forecasts were trained on it.
TEST(Variants, OfAnotherSeedOrOfSomeShardsAloneAreRefused) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  const std::filesystem::path first = folder / "shards/shard_00000.safetensors",
                              second = folder / "shards/shard_00001.safetensors";
  const TensorMetadata said = TensorFile::Open(second).metadata();
  std::filesystem::copy_file(first, second, std::filesystem::copy_options::overwrite_existing);  // two of one split
  ASSERT_EQ(said.at("recipe"), RecipeOf(folder / "shards"));
  const auto vary = [&](const std::filesystem::path& shard, const char* count, const char* seed) {
    WriteVariantsOf(shard, 1, {{"recipe", said.at("recipe")}, {"count", count}, {"seed", seed}});
  };
  const auto opened = [&] {
    ShardSet set(folder / "shards", Split::kTrain);
    set.OpenVariants();
    return set.variants().size();
  };
  vary(first, "4", "1");
  const std::string others = ", shard_00000.safetensors has variants of count 4 and seed 1: wanted the same of all";
  EXPECT_THAT(opened, ThrowsMessage<TensorError>(HasSubstr("shard_00001.safetensors has no variants" + others)));
  vary(second, "4", "2");
  EXPECT_THAT(opened, ThrowsMessage<TensorError>(HasSubstr("has variants of count 4 and seed 2" + others)));
  vary(second, "3", "1");
  EXPECT_THAT(opened, ThrowsMessage<TensorError>(HasSubstr("count 3 and seed 1")));
  vary(second, "4", "1");
  EXPECT_EQ(opened(), 12u);
}

TEST(TrainForecast, RefusesShardsThatDoNotSayWhereTheirObjectIs) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {.knows_object = false});
  EXPECT_THAT([&] { TrainForecast({{folder / "shards"}, folder / "out", ForecastConfig(1)}, Quick(1)); },
              ThrowsMessage<TensorError>(HasSubstr("say where their objects are")));
}

/// No copy of the network was made, and the first of none was trained.
TEST(TrainForecast, RefusesAStepOfNoParts) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  ForecastOptions options = Quick(1);
  options.job.trainer.accumulate = 0;
  EXPECT_THAT([&] { TrainForecast({{folder / "shards"}, folder / "out", ForecastConfig(1)}, options); },
              ThrowsMessage<TensorError>(HasSubstr("training: accumulate is 0")));
}

/// Its hold-out counted twice too.
TEST(TrainForecast, AFolderThatIsNamedTwiceIsMeasuredOnce) {
  const TempFolder folder;
  const std::filesystem::path shards = folder / "shards";
  WriteSyntheticShards(shards, {.clips = 6, .failures = 3});
  JobPlace place{ShardFolders{shards, shards}, folder / "out", ForecastConfig(1)};
  std::string said;
  place.say = [&](const std::string& sentence) { said += sentence + "\n"; };
  TrainForecast(place, Quick(1));
  EXPECT_THAT(said, HasSubstr(" of 6 outcomes told"));
}

TEST(TrainForecast, RefusesSizesThatHaveNone) {
  const TempFolder folder;
  WriteSyntheticShards(folder / "shards", {});
  EXPECT_THAT([&] { TrainForecast({{folder / "shards"}, folder / "out", nn::TinyConfig()}, Quick(1)); },
              ThrowsMessage<TensorError>(HasSubstr("object_forecast: false, wanted true")));
}

TEST(TrainWorld, IsShownAForecastThatStaysAsItWasGiven) {
  const TempFolder folder;
  const nn::ModelConfig config = ForecastConfig(1);
  WriteSyntheticShards(folder / "shards", {});
  CodecOptions codec;
  codec.job.trainer.steps = 2;
  codec.codec.batch = 4;
  TrainCodec({{folder / "shards"}, folder / "codec", config}, codec);
  WorldStart start{folder / "codec" / "codec.safetensors"};
  CheckpointWeights codec_weights(start.codec);
  const nn::Vae vae(nn::Scope(codec_weights, kCodecPrefix), config.vae);
  EncodeSyntheticShards(vae, folder / "shards");
  TrainForecast({{folder / "shards"}, folder / "forecast", config}, Quick(20));
  start.forecast = folder / "forecast" / "forecast.safetensors";
  WorldOptions options;
  options.job.trainer.steps = 3;
  options.job.holdout_size = 2;
  options.world.batch = 2;
  options.world.windows.history = 6;
  options.world.windows.first_image = true;
  options.world.self_memory_share = 1;
  options.world.self_memory_from = 0;
  EXPECT_EQ(TrainWorld({{folder / "shards"}, folder / "world", config}, options, start, {}).why, "done");
  nn::MappedTensors given(TensorFile::Open(start.forecast)),
      kept(TensorFile::Open(folder / "world" / "weights.safetensors"));
  for (const char* key : {"finder.0.weight", "eye.weight", "hand.bias", "places.weight", "success.bias"}) {
    const std::string whole = std::string(nn::kForecastPrefix) + "." + key;
    EXPECT_TRUE(at::equal(given.Get(whole), kept.Get(whole))) << key;
  }
  options.world.windows.first_image = false;
  EXPECT_THAT([&] { TrainWorld({{folder / "shards"}, folder / "other", config}, options, start, {}); },
              ThrowsMessage<TensorError>(HasSubstr("first_image is false")));
}

}  // namespace
}  // namespace evac::train
