#include "worldmodel/train/imagine_shards.h"

#include <ATen/ops/allclose.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/hash.h"
#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/weight_files.h"
#include "worldmodel/train/world_batch.h"

namespace evac::train {
namespace {

nn::ModelConfig SmallConfig() {
  nn::ModelConfig config = nn::TinyConfig();
  config.vae.channel_mult = {1, 1, 1};
  config.vae.patch_px = 1;
  config.unet.channel_mult = {1, 1};
  config.views = 2;
  return config;
}

/// Encoded shards of clips of a first picture, two chunks and `left_over` frames, and a model of random weights.
struct Scene {
  explicit Scene(std::int64_t left_over = 0, std::int64_t memory = SmallConfig().memory)
      : config(WithMemory(memory)), model(random, config) {
    WriteSyntheticShards(folder / "shards", {.clips = 3, .frames = 1 + 2 * config.chunk + left_over, .views = 2});
    EncodeSyntheticShards(model.vae(), folder / "shards");
    Open();
  }
  static nn::ModelConfig WithMemory(std::int64_t memory) {
    nn::ModelConfig config = SmallConfig();
    config.memory = memory;
    return config;
  }
  void Open() {
    shards.emplace(folder / "shards", Split::kTrain);
    shards->OpenLatents(config.vae.z_channels, config.vae.Stride());
  }
  /// The pictures of each clip from `frame` on become grey; the latents stay.
  void Grey(std::int64_t frame) {
    const std::vector<Clip> clips = shards->clips();
    ChangeSyntheticShard(folder / "shards", [&](const std::string& name, Tensor& tensor) {
      if (name != "frames") return;
      for (const Clip& clip : clips) tensor.narrow(0, clip.first + frame, clip.frames - frame).fill_(127);
    });
    Open();
  }
  Tensor Truth(const Clip& clip) const {
    return shards->shards()[clip.shard].latents.narrow(0, clip.first, clip.frames).to(at::kFloat);
  }
  std::vector<Tensor> Imagined(std::int64_t batch = 8, std::uint64_t seed = 0) const {
    return ImagineClips(model, *shards, shards->clips(), {.steps = 2, .batch = batch, .seed = seed});
  }

  TempFolder folder;
  nn::ModelConfig config;
  nn::HashWeights random;
  nn::EvacModel model;
  std::optional<ShardSet> shards;
};

TEST(ImagineClips, BeginsWithWhatWasSeenAndImaginesTheRest) {
  const Scene at;
  const std::vector<Tensor> imagined = at.Imagined();
  ASSERT_EQ(imagined.size(), 3U);
  for (std::size_t i = 0; i < imagined.size(); ++i) {
    const Tensor truth = at.Truth(at.shards->clips()[i]);
    ASSERT_EQ(imagined[i].sizes(), truth.sizes());
    EXPECT_TRUE(imagined[i][0].equal(truth[0]));
    for (std::int64_t frame = 1; frame < truth.size(0); ++frame)
      EXPECT_GT((imagined[i][frame] - truth[frame]).abs().max().item<double>(), 1e-3) << frame;
  }
}

TEST(ImagineClips, EachIsAFunctionOfItselfAndTheSeed) {
  const Scene at;
  const std::vector<Tensor> together = at.Imagined(3), alone = at.Imagined(1), other = at.Imagined(3, 1);
  for (std::size_t i = 0; i < together.size(); ++i) {
    EXPECT_TRUE(at::allclose(together[i], alone[i], 1e-4, 1e-4)) << i;
    EXPECT_FALSE(at::allclose(together[i], other[i], 1e-2, 1e-2)) << i;
  }
}

/// The second chunk remembers the first as it was imagined, not as it was: the same as asking by hand.
TEST(ImagineClips, RemembersWhatItImagined) {
  const Scene at;
  const Clip& clip = at.shards->clips().front();
  const std::vector<Tensor> imagined = at.Imagined();
  const std::int64_t chunk = at.config.chunk, memory = at.config.memory;
  const Window window{&clip, RolloutMemory(chunk, memory), chunk, chunk, 0};
  const WorldBatch batch = MakeWorldBatch(*at.shards, {window});
  const auto second = [&](const Tensor& remembered) {
    const nn::ChunkRequest request{
        remembered.index_select(0, at::tensor(window.memory, at::kLong)).permute({1, 2, 0, 3, 4}).contiguous(),
        batch.images,
        batch.pose_maps.narrow(2, memory, chunk),
        batch.direction,
        batch.origin,
        batch.deltas,
        batch.arms};
    std::vector<std::int64_t> shape = request.memory.sizes().vec();
    shape[2] = chunk;
    nn::ImagineOptions sampler;
    sampler.solver = nn::Solver::kDpmSolver;
    sampler.steps = 2;
    const at::NoGradGuard no_gradients;
    const Tensor start = Dice({0, clip.first + chunk, 0, 0}, 31).Normal(shape);
    return nn::ImagineChunk(at.model, request, {start, {}}, sampler).narrow(2, memory, chunk).permute({2, 0, 1, 3, 4});
  };
  const Tensor found = imagined.front().narrow(0, chunk + 1, chunk);
  EXPECT_TRUE(at::allclose(found, second(imagined.front()), 1e-4, 1e-4));
  EXPECT_FALSE(at::allclose(found, second(at.Truth(clip)), 1e-3, 1e-3));
}

/// With a memory of one frame the image encoder was shown the recorded picture of it, chunk after chunk.
TEST(ImagineClips, OfWhatWasRecordedOnlyTheFirstPictureIsShown) {
  for (const std::int64_t memory : {1, 2}) {
    Scene at(1, memory);
    const std::vector<Tensor> before = at.Imagined();
    at.Grey(1);
    const std::vector<Tensor> later_ones_grey = at.Imagined();
    at.Grey(0);
    const std::vector<Tensor> all_grey = at.Imagined();
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_TRUE(later_ones_grey[i].equal(before[i])) << memory << ", clip " << i;
      EXPECT_FALSE(at::allclose(all_grey[i], before[i], 1e-4, 1e-4)) << memory << ": or nothing is shown";
    }
  }
}

TEST(ImagineClips, FramesLeftOverBehindTheLastWholeChunkAreImaginedToo) {
  const Scene at(2);
  const Clip& clip = at.shards->clips().front();
  const Tensor imagined = at.Imagined().front(), truth = at.Truth(clip);
  EXPECT_GT((imagined[clip.frames - 1] - truth[clip.frames - 1]).abs().max().item<double>(), 1e-3);
}

TEST(ImagineClips, RefusesAClipWithoutAChunk) {
  const Scene at;
  Clip clip = at.shards->clips().front();
  clip.frames = at.config.chunk;
  EXPECT_THAT([&] { ImagineClips(at.model, *at.shards, {clip}, {}); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("frames, wanted")));
}

TEST(WriteImaginedLatents, StandWhereTrainingLooksForThem) {
  const Scene at;
  const std::filesystem::path to = at.folder / "imagined";
  std::filesystem::create_directories(to);
  for (const auto& entry : std::filesystem::directory_iterator(at.folder / "shards")) {
    if (!entry.path().filename().string().starts_with("latents_"))
      std::filesystem::copy_file(entry.path(), to / entry.path().filename());
  }
  WriteImaginedLatents(at.model, *at.shards, 0, to, "imagined", {});
  ShardSet imagined(to, Split::kTrain);
  imagined.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
  EXPECT_EQ(imagined.codec(), "codec");
  const std::filesystem::path shard = imagined.shards().front().path;
  EXPECT_TRUE(IsEncoded(shard, {"codec", Sha256HexOfFile(shard), "imagined"}));
  const Clip& clip = imagined.clips().back();
  const Tensor found = imagined.shards().front().latents.narrow(0, clip.first, clip.frames).to(at::kFloat);
  EXPECT_TRUE(at::allclose(found, at.Imagined().back(), 1e-2, 1e-2)) << "halves";
  EXPECT_TRUE(imagined.shards().front().map_latents.equal(at.shards->shards().front().map_latents));
}

/// The hash weights, whose answers are beyond what halves hold.
class Loud final : public nn::ParameterSource {
 public:
  Tensor Take(const std::string& key, at::IntArrayRef shape) override {
    const Tensor tensor = weights_.Take(key, shape);
    return key.starts_with("model.diffusion_model.out.") ? tensor * 1e9 : tensor;
  }

 private:
  nn::HashWeights weights_;
};

/// They stood there as infinite, and a judge learned from them.
TEST(WriteImaginedLatents, ThatAreNoNumbersAreRefusedWithShardAndClip) {
  const Scene at;
  Loud source;
  const nn::EvacModel loud(source, at.config);
  const std::filesystem::path to = at.folder / "imagined";
  std::filesystem::create_directories(to);
  EXPECT_THAT([&] { WriteImaginedLatents(loud, *at.shards, 0, to, "imagined", {}); },
              testing::ThrowsMessage<TensorError>(
                  testing::AllOf(testing::HasSubstr("shard_00000.safetensors: "),
                                 testing::HasSubstr("numbers of what is imagined of clip 0 are not finite"))));
  EXPECT_TRUE(std::filesystem::is_empty(to));
}

}  // namespace
}  // namespace evac::train
