#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/hash.h"
#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/train_codec.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

nn::VaeConfig SmallCodec(std::int64_t patch_px) {
  nn::VaeConfig config = nn::TinyConfig().vae;
  config.patch_px = patch_px;
  config.z_channels = 8;
  config.scale_factor = 0.5;
  return config;
}

struct Trained {
  CodecQuality before, after;
};
Trained Train(const ShardSet& shards, const nn::VaeConfig& config, const CodecTrainingOptions& options, at::ScalarType products) {
  nn::RandomWeights random(1);
  TrainableWeights weights(random, products);
  const nn::Vae vae(nn::Scope(weights, kCodecPrefix), config);
  const CodecTraining training(shards, config, options);
  TrainerOptions trainer;
  trainer.steps = 60;
  trainer.learning_rate = 5e-3;
  trainer.clip_norm = 1;
  Trained trained;
  trained.before = MeasureCodec(vae, shards, 12);
  const TempFolder out;
  Trainer(weights.all(), trainer, out.path()).Run({.loss = [&](const StepPlace& at) { return training.Loss(vae, training.Batch(at)); }});
  trained.after = MeasureCodec(vae, shards, 12);
  return trained;
}

TEST(CodecTraining, PicturesAndMapsComeBackBetterThanBefore) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  const ShardSet shards(folder.path(), Split::kTrain);
  const CodecTrainingOptions options{.batch = 8, .map_share = 0.4, .foreground_weight = 4, .contact_share = 0.3};
  for (const at::ScalarType products : {at::kFloat, at::kBFloat16}) {
    const Trained trained = Train(shards, SmallCodec(2), options, products);
    EXPECT_GT(trained.after.psnr, trained.before.psnr + 3);
    EXPECT_GT(trained.after.psnr_object, trained.before.psnr_object + 3);
    EXPECT_GT(trained.after.psnr_maps, trained.before.psnr_maps + 3);
  }
}

TEST(CodecTraining, NormalisedLatentsHaveUnitDeviationAndDecodeTheSame) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  const ShardSet shards(folder.path(), Split::kTrain);
  const nn::VaeConfig config = SmallCodec(1);
  nn::HashWeights hashes;
  TrainableWeights weights(hashes);
  const nn::Vae vae(nn::Scope(weights, kCodecPrefix), config);
  const at::NoGradGuard no_gradients;
  const Tensor pictures = PicturesFrom(shards.shards().front().frames.select(1, 0));
  const auto latents = [&] { return vae.Encode(pictures).Sample({}) * config.scale_factor; };
  const Tensor before = vae.Decode(latents());
  NormaliseLatents(vae, shards, weights.all(), true);
  const Tensor by_channel = latents().transpose(0, 1).flatten(1);
  EXPECT_LT(by_channel.mean(1).abs().max().item<double>(), 1e-3);
  EXPECT_LT((by_channel.std(1) - 1).abs().max().item<double>(), 1e-3);
  EXPECT_LT(nn::LargestDifference(vae.Decode(latents()), before), 2e-4);
  const Tensor noise = nn::Noise({pictures.size(0), 8, 8, 12}, 3);
  EXPECT_LT(nn::LargestDifference(vae.Encode(pictures).Sample(noise) * config.scale_factor, latents()), 1e-5)
      << "the posterior is a point";
}

TEST(EncodeShard, WritesTheLatentsOfEveryPictureAndMap) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.views = 2});
  nn::RandomWeights random(1);
  const nn::VaeConfig config = SmallCodec(2);
  const nn::Vae vae(nn::Scope(random, kCodecPrefix), config);
  const auto paths = ShardPaths(folder.path());
  const std::string sha256 = Sha256HexOfFile(paths[0]);
  const EncodeOptions options{"the codec's hash", sha256};
  EXPECT_FALSE(IsEncoded(paths[0], options));
  for (const auto& path : paths) EncodeShard(vae, path, {"the codec's hash", Sha256HexOfFile(path)});
  EXPECT_TRUE(IsEncoded(paths[0], options));
  EXPECT_FALSE(IsEncoded(paths[0], {"another codec", sha256}));
  EXPECT_FALSE(IsEncoded(paths[0], {"the codec's hash", "another shard's hash"}));
  EXPECT_FALSE(IsEncoded(paths[0], {"the codec's hash", sha256, "bfloat16"}));
  ShardSet shards(folder.path(), Split::kHoldout);
  shards.OpenLatents(8, config.Stride());
  const Shard& shard = shards.shards().front();
  const at::NoGradGuard no_gradients;
  const Tensor map = vae.Encode(PicturesFrom(shard.maps[7])).Sample({}) * config.scale_factor;
  EXPECT_LT(nn::LargestDifference(shard.map_latents[7], map), 2e-3) << "halves";
  EXPECT_EQ(shards.codec(), "the codec's hash");
}

TEST(EncodeShard, LatentsTimesAnotherScaleFactorAreRefused) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  nn::VaeConfig config = SmallCodec(2);
  config.scale_factor = 1;
  nn::RandomWeights random(1);
  EncodeSyntheticShards(nn::Vae(nn::Scope(random, kCodecPrefix), config), folder.path());
  const std::filesystem::path shard = ShardPaths(folder.path()).front();
  const auto is_encoded = [&](std::optional<double> scale_factor) {
    return IsEncoded(shard, {"codec", Sha256HexOfFile(shard), "float32", scale_factor});
  };
  const auto open = [&](std::optional<double> scale_factor) {
    ShardSet(folder.path(), Split::kTrain).OpenLatents(config.z_channels, config.Stride(), scale_factor);
  };
  EXPECT_TRUE(is_encoded(1));
  EXPECT_TRUE(is_encoded({})) << "not asked";
  EXPECT_FALSE(is_encoded(0.5));
  EXPECT_NO_THROW(open(1));
  EXPECT_THAT([&] { open(0.5); },
              testing::ThrowsMessage<TensorError>(
                  testing::AllOf(testing::HasSubstr("latents_00000.safetensors"),
                                 testing::HasSubstr("scale_factor is '1', wanted '0.5'"))));
  EXPECT_TRUE(MayBeScaledBy({{"codec", "codec"}}, 0.5)) << "latents of earlier versions do not say it";
}

TEST(MeasureCodec, AnObjectFarOutsideThePictureIsNotSeen) {
  nn::RandomWeights random(1);
  const nn::Vae vae(nn::Scope(random, kCodecPrefix), SmallCodec(2));
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  EXPECT_NE(MeasureCodec(vae, ShardSet(folder.path(), Split::kTrain), 12).psnr_object, 0);
  for (const double far : {1e30, -1e30, HUGE_VAL, -HUGE_VAL}) {
    ChangeSyntheticShard(folder.path(), [&](const std::string& name, Tensor& tensor) {
      if (name == "object_px") tensor.fill_(far);
    });
    EXPECT_EQ(MeasureCodec(vae, ShardSet(folder.path(), Split::kTrain), 12).psnr_object, 0) << far;
  }
}

TEST(ShardSet, RefusesWhatNoTrainingCanRead) {
  const TempFolder folder;
  EXPECT_THROW(ShardSet(folder.path(), Split::kTrain), TensorError) << "the packing is not done";
  WriteSyntheticShards(folder.path(), {});
  EXPECT_THROW(ShardSet(folder.path(), Split::kTrain).OpenLatents(8, 4), TensorError) << "no latents yet";
  const ShardSet shards(folder.path(), Split::kTrain);
  EXPECT_EQ(shards.clips().size(), 6u);
  EXPECT_EQ(shards.frame_count(), 54);
}

TEST(ShardSet, SeveralPackingsAreOneSetAndOneThatIsNamedTwiceCountsTwice) {
  const TempFolder folder;
  const std::filesystem::path a = folder / "a", b = folder / "b", other = folder / "other";
  WriteSyntheticShards(a, {.clips = 6, .seed = 1});
  WriteSyntheticShards(b, {.clips = 4, .seed = 2});
  const ShardSet shards(ShardFolders{a, b, b}, Split::kTrain);
  EXPECT_EQ(shards.clips().size(), 14u);
  EXPECT_EQ(shards.clips()[13].shard, 2u);
  EXPECT_EQ(shards.shards()[2].path.parent_path(), b);
  EXPECT_EQ(shards.metadata().at("recipe"), "1,2,2") << "a training knows what it is a training on";
  EXPECT_TRUE(shards.shards()[1].frames.equal(ShardSet(b, Split::kTrain).shards()[0].frames));
  WriteSyntheticShards(other, {.statistics = "of another robot"});
  EXPECT_THAT([&] { ShardSet(ShardFolders{a, other}, Split::kTrain); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("statistics differs")));
}

TEST(ShardSet, RefusesAFolderWhoseShardsAreNotAllThere) {
  const TempFolder folder;
  const auto refusal = [&](const std::string& words) {
    EXPECT_THAT([&] { ShardSet(folder.path(), Split::kTrain); },
                testing::ThrowsMessage<TensorError>(testing::HasSubstr(words)));
  };
  WriteSyntheticShards(folder.path(), {});
  const std::filesystem::path first = folder / "shard_00000.safetensors", second = folder / "shard_00001.safetensors",
                              third = folder / "shard_00002.safetensors";
  std::filesystem::rename(second, third);
  refusal("its packing has 2 shards, missing are shard_00001.safetensors: wanted all");
  std::filesystem::copy(third, second);
  refusal("shard_00002.safetensors is none of them");
  std::filesystem::remove(third);
  EXPECT_EQ(ShardPaths(folder.path()), (std::vector<std::filesystem::path>{first, second}));
  std::filesystem::remove(first);
  refusal("missing are shard_00000.safetensors");
  std::filesystem::remove(second);
  refusal("has shards.json and no shard");
}

TEST(ShardSet, TakesToldAndMeasuredArmsTogetherOnlyWhereOneDoesNotSayWhichTheyAre) {
  const TempFolder folder;
  const std::filesystem::path told = folder / "told", measured = folder / "measured", before = folder / "before";
  WriteSyntheticShards(told, {.arms_read = "told"});
  WriteSyntheticShards(measured, {.arms_read = "measured"});
  WriteSyntheticShards(before, {});
  for (const ShardFolders& folders : {ShardFolders{told, measured}, ShardFolders{before, measured, told}})
    EXPECT_THAT([&] { ShardSet(folders, Split::kTrain); },
                testing::ThrowsMessage<TensorError>(testing::HasSubstr("arms_read differs")));
  EXPECT_EQ(ShardSet(ShardFolders{before, told}, Split::kTrain).metadata().at("arms_read"), "told");
  EXPECT_EQ(ShardSet(ShardFolders{told, before, told}, Split::kTrain).metadata().at("arms_read"), "told");
  EXPECT_FALSE(ShardSet(before, Split::kTrain).metadata().contains("arms_read"));
}

TEST(ShardSet, PackingsOfOtherTasksAreOneSetWithAllOfTheirs) {
  const TempFolder folder;
  const std::filesystem::path a = folder / "a", b = folder / "b", broken = folder / "broken";
  WriteSyntheticShards(a, {.clips = 2, .tasks = "pour,wipe", .task = 1});
  WriteSyntheticShards(b, {.clips = 3, .tasks = "fold,pour", .task = 1});
  for (const Split split : {Split::kTrain, Split::kHoldout}) {
    const ShardSet shards(ShardFolders{a, b}, split);
    EXPECT_EQ(shards.metadata().at("tasks"), "pour,wipe,fold");
    ASSERT_EQ(shards.clips().size(), 5u);
    EXPECT_EQ(shards.clips()[0].task, 1) << "wipe";
    EXPECT_EQ(shards.clips()[4].task, 0) << "pour";
  }
  WriteSyntheticShards(broken, {.tasks = "pour,wipe", .task = 2});
  EXPECT_THAT([&] { ShardSet(broken, Split::kTrain); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("clip 0 is of task 2, wanted 0 … 1")));
}

}  // namespace
}  // namespace evac::train
