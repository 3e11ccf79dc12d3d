#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/prepared_world.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/frame_memory.h"
#include "worldmodel/nn/dpm_solver.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/ray_map.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"
#include "worldmodel/train/world_training.h"

namespace evac::train {
namespace {

TEST(TrainCodec, GoesOnFromACodecThatIsGiven) {
  Prepared at(1);
  const auto psnr = [&](const char* out, std::int64_t steps, double rate, const std::filesystem::path& init) {
    CodecOptions options;
    options.job.trainer.steps = steps;
    options.job.trainer.learning_rate = rate;
    options.job.trainer.clip_norm = 1;
    options.codec.batch = 8;
    options.codec.latent_noise = 0.05;
    TrainCodec({{at.folder / "shards"}, at.folder / out, at.config}, options, init);
    return std::stod(CheckpointWeights(at.folder / out / "codec.safetensors").file().metadata().at("psnr"));
  };
  const std::filesystem::path first = at.folder / "first" / "codec.safetensors";
  const double learned = psnr("first", 60, 5e-3, {});
  EXPECT_NEAR(psnr("second", 1, 1e-9, first), learned, 0.1);
  EXPECT_LT(psnr("fresh", 1, 1e-9, {}), learned - 1);
  at.config.vae.channels *= 2;
  EXPECT_THAT([&] { psnr("other", 1, 1e-9, first); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("first_stage_model")));
}

/// The loss on the training's own windows, before and after some steps.
std::pair<double, double> LossBeforeAndAfter(const Prepared& at, WorldOptions options) {
  options.Resolve();
  options.world.windows.chunk = at.config.chunk;
  options.world.windows.memory = at.config.memory;
  ShardSet shards(at.folder / "shards", Split::kTrain);
  shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
  nn::RandomWeights random(3, nn::RandomWeights::LastLayers::kZero);
  TrainableWeights weights(random, options.job.bf16 ? at::kBFloat16 : at::kFloat);
  const nn::EvacModel model(weights, at.config);
  const WorldTraining training(model, shards, options.world);
  const std::vector<Window> windows = training.sampler().Spread(8);
  const double before = training.Measure(windows);
  const TempFolder out;
  Trainer trainer(TrainedParameters(weights, at.config, options.world), options.job.trainer, out.path());
  trainer.Run({.loss = [&](const StepPlace& place) { return training.Loss(place); }});
  return {before, training.Measure(windows)};
}

TEST(TrainWorld, TheLossFallsWithOneView) {
  const auto [before, after] = LossBeforeAndAfter(Prepared(1), Quick(30));
  EXPECT_LT(after, 0.9 * before);
}

TEST(TrainWorld, TheLossFallsWithHeadAndWrist) {
  const auto [before, after] = LossBeforeAndAfter(Prepared(2), Quick(30));
  EXPECT_LT(after, 0.9 * before);
}

TEST(TrainWorld, TheLossFallsInBf16) {
  WorldOptions options = Quick(30);
  options.job.bf16 = true;
  const auto [before, after] = LossBeforeAndAfter(Prepared(1), options);
  EXPECT_LT(after, 0.9 * before);
}

TEST(TrainWorld, TheLossFallsWithEverythingThatThePaperLacks) {
  WorldOptions options = Quick(30);
  options.world.windows.rollout_share = 0.5;
  options.world.windows.contact_share = 0.5;
  options.world.windows.first_image = true;
  options.memory_noise_kind = "uniform";
  options.world.terminal_share = 0.3;
  options.world.log_uniform = true;
  options.step_weight = "clean";
  options.world.windows.closing_share = 0.5;
  options.world.reach_weight = 4;
  options.world.squared_below = 0.2;
  options.world.object_weight = 4;
  options.world.change_weight = 2;
  options.world.self_memory_share = 0.5;
  options.world.self_memory_from = 0.2;
  options.world.train_action_resampler = true;
  options.world.train_image_encoder = true;
  Prepared at(1);
  at.config.schedule.from_last_frame = true;
  at.config.schedule.carry_plane_m = 0;
  at.config.unet.in_channels += at.config.vae.z_channels + 1;
  at.config.unet.frame_actions = true;
  at.config.unet.hand_views = 1;
  at.config.action_resampler.embedding_dim = 18;
  const auto [before, after] = LossBeforeAndAfter(at, options);
  EXPECT_LT(after, 0.9 * before);
}

TEST(TrainWorld, NoiseThatASamplerAsksAboutIsTrained) {
  const nn::ModelConfig config = nn::TinyConfig();
  const nn::NoiseSchedule schedule(config.schedule);
  const WorldTrainingOptions options;
  for (std::int64_t calls = 2; calls <= 20; ++calls) {
    const std::vector<std::int64_t> steps = nn::DpmSolverSteps(schedule, calls);
    for (std::size_t i = 1; i + 1 < steps.size(); ++i) {  // pure noise has a share of its own; step 0 is clean
      const double alpha_bar = schedule.AlphaBar(steps[i]), ratio = std::sqrt((1 - alpha_bar) / alpha_bar);
      EXPECT_LE(ratio, options.ratio_to) << calls << " calls, step " << steps[i];
      if (calls <= 6) {
        EXPECT_GE(ratio, options.ratio_from) << calls << " calls, step " << steps[i];
      }
    }
  }
}

TEST(TrainWorld, AViewsErrorsCountAsMuchAsItsWeight) {
  const Prepared at(2);
  ShardSet shards(at.folder / "shards", Split::kTrain);
  shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
  nn::RandomWeights random(3);
  TrainableWeights weights(random);
  const nn::EvacModel model(weights, at.config);
  const auto loss = [&](const std::string& view_weights) {
    WorldOptions options = Quick(1);
    options.view_weights = view_weights;
    options.Resolve();
    options.world.windows.chunk = at.config.chunk;
    options.world.windows.memory = at.config.memory;
    const WorldTraining training(model, shards, options.world);
    return training.Measure(training.sampler().Spread(8));
  };
  const double alike = loss(""), first = loss("1,1e-9"), second = loss("1e-9,1");
  EXPECT_GT(std::abs(first - second), 1e-3 * alike) << "or nothing is tested";
  EXPECT_NEAR(alike, (first + second) / 2, 1e-4 * alike);
  EXPECT_NEAR(loss("3,3"), alike, 1e-5 * alike);
  EXPECT_NEAR(loss("3,1"), (3 * first + second) / 4, 1e-4 * alike);
  for (const char* wrong : {"1,-1", "1,0", "1,x", "1,,1", "1,inf"}) EXPECT_THROW(loss(wrong), TensorError) << wrong;
  WorldOptions three = Quick(1);
  three.view_weights = "1,1,1";
  EXPECT_THROW(TrainWorld({{at.folder / "shards"}, at.folder / "out", at.config}, three, {.codec = at.codec()}, {}),
               TensorError);
}

TEST(TrainWorld, MemoryIsImaginedSoManyChunksDeep) {
  const Prepared at(1, 10);
  ShardSet shards(at.folder / "shards", Split::kTrain);
  shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
  nn::RandomWeights random(3);
  TrainableWeights weights(random);
  const nn::EvacModel model(weights, at.config);
  const auto loss = [&](std::int64_t chunks, double share) {
    WorldOptions options = Quick(1);
    options.world.windows.rollout_share = 1;
    options.world.self_memory_share = share;
    options.world.self_memory_chunks = chunks;
    options.Resolve();
    options.world.windows.chunk = at.config.chunk;
    options.world.windows.memory = at.config.memory;
    return WorldTraining(model, shards, options.world).Loss({5, 0, 0, 1}).item<double>();
  };
  const std::int64_t deepest = (shards.clips().front().frames - 1) / at.config.chunk - 1;
  ASSERT_EQ(deepest, 2) << "or there is no chunk before the one before";
  EXPECT_NE(loss(1, 1), loss(1, 0));
  EXPECT_NE(loss(2, 1), loss(1, 1));
  EXPECT_EQ(loss(2, 1), loss(7, 1)) << "before the first chunk nothing was imagined";
  EXPECT_EQ(loss(2, 0), loss(1, 0));
  EXPECT_THROW(loss(0, 1), TensorError);
}

/// The network remembered its own frame, and the image encoder saw the recorded one.
TEST(TrainWorld, AMemoryOfOneFrameIsShownAsItWasImagined) {
  Prepared at(1, 10);
  at.config.memory = 1;
  const auto loss = [&](double share) {
    ShardSet shards(at.folder / "shards", Split::kTrain);
    shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
    nn::RandomWeights random(3);
    TrainableWeights weights(random);
    const nn::EvacModel model(weights, at.config);
    WorldOptions options = Quick(1);
    options.world.windows.rollout_share = 1;
    options.world.self_memory_share = share;
    options.world.self_memory_chunks = 9;
    options.Resolve();
    options.world.windows.chunk = at.config.chunk;
    options.world.windows.memory = at.config.memory;
    return WorldTraining(model, shards, options.world).Loss({5, 0, 0, 1}).item<double>();
  };
  const double own = loss(1), recorded = loss(0);
  ChangeSyntheticShard(at.folder / "shards", [](const std::string& name, Tensor& tensor) {
    if (name != "frames") return;
    for (std::int64_t row = 0; row < tensor.size(0); ++row) {
      if (row % 10 != 0) tensor[row].fill_(127);  // all but the first of each clip
    }
  });
  EXPECT_EQ(loss(1), own);
  EXPECT_NE(loss(0), recorded) << "or nothing is shown";
}

TEST(TrainWorld, NoiseOnMemoryIsNoChangeOfTheScene) {
  const auto loss = [](const Prepared& at, const char* noise, double unless_changed) {
    ShardSet shards(at.folder / "shards", Split::kTrain);
    shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
    nn::ModelConfig config = at.config;
    config.schedule.from_last_frame = true;
    config.schedule.carry_plane_m = 0;
    config.schedule.carry_frames = config.memory;
    config.schedule.carry_unless_changed = unless_changed;
    config.unet.in_channels += config.vae.z_channels + 1;
    config.Check();
    nn::RandomWeights random(3);
    TrainableWeights weights(random);
    const nn::EvacModel model(weights, config);
    WorldOptions options = Quick(1);
    options.memory_noise_kind = noise;
    options.world.memory_noise_share = 1;
    options.Resolve();
    options.world.windows.chunk = config.chunk;
    options.world.windows.memory = config.memory;
    return WorldTraining(model, shards, options.world).Loss({5, 0, 0, 1}).item<double>();
  };
  const Prepared still(SyntheticShards{.views = 2, .step_px = 0, .wrist_swing_m = 0.5}),
      moving(SyntheticShards{.views = 2, .wrist_swing_m = 0.5});
  for (const char* noise : {"published", "uniform"}) {
    EXPECT_EQ(loss(still, noise, 1e-3), loss(still, noise, 0)) << noise;
    EXPECT_NE(loss(moving, noise, 1e-3), loss(moving, noise, 0)) << noise << ": or nothing is tested";
  }
}

std::string Bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(TrainWorld, EndsInTheSameBytesWhenItWasKilledAndItsWeightsImagine) {
  const Prepared at(1);
  WorldOptions options = Quick(6);
  options.job.trainer.holdout_every = 3;
  options.job.trainer.checkpoint_every_s = 0;
  options.job.trainer.average_decay = 0.9;
  options.world.train_action_resampler = true;
  const WorldStart start{at.codec()};
  const JobPlace whole{{at.folder / "shards"}, at.folder / "whole", at.config};
  TrainWorld(whole, options, start, {});
  int left = 0;
  for (const auto& [steps, reached] : {std::pair(2, 2), std::pair(1, 3), std::pair(100, 6)}) {
    left = steps;
    JobPlace killed{{at.folder / "shards"}, at.folder / "killed", at.config};
    killed.interrupted = [&] { return left-- == 0; };
    EXPECT_EQ(TrainWorld(killed, options, start, {}).step, reached) << "what was done before is not done again";
  }
  EXPECT_EQ(Bytes(at.folder / "whole" / "weights.safetensors"), Bytes(at.folder / "killed" / "weights.safetensors"));
  const nn::EvacModel model = nn::LoadModel(at.folder / "whole" / "weights.safetensors", at.config);
  EXPECT_EQ(model.config().chunk, at.config.chunk) << "the file is a strict checkpoint of the network";
}

TEST(TrainWorld, GoesOnFromAnotherModelStrictlyButForWhatIsExcepted) {
  const Prepared at(1);
  TrainWorld({{at.folder / "shards"}, at.folder / "first", at.config}, Quick(2), {at.codec()}, {});
  WorldStart start{at.codec(), at.folder / "first" / "weights.safetensors"};
  nn::ModelConfig other = at.config;
  other.action_resampler.queries = 5;
  const JobPlace place{{at.folder / "shards"}, at.folder / "second", other};
  EXPECT_THROW(TrainWorld(place, Quick(1), start, {}), TensorError);
  start.init_except = {"cond_stage_model.latents"};
  EXPECT_EQ(TrainWorld(place, Quick(1), start, {}).why, "done");
}

TEST(TrainWorld, GoesOnFromAModelThatWasShownLess) {
  Prepared at(1);
  at.config.schedule.from_last_frame = true;
  at.config.schedule.carry_plane_m = 0;
  at.config.unet.in_channels += at.config.vae.z_channels + 1;
  const auto end = [&](const char* out, const nn::ModelConfig& config, double rate, const WorldStart& start) {
    WorldOptions options = Quick(rate > 1e-9 ? 20 : 1);
    options.job.trainer.learning_rate = rate;
    options.job.trainer.holdout_every = options.job.trainer.steps;
    return TrainWorld({{at.folder / "shards"}, at.folder / out, config}, options, start, {}).best.value();
  };
  WorldStart start{at.codec()};
  const double before = end("first", at.config, 3e-3, start);
  start.init = at.folder / "first" / "weights.safetensors";
  nn::ModelConfig more = at.config;
  more.schedule.carry_first = true;
  more.unet.in_channels += at.config.vae.z_channels + 1;
  EXPECT_THROW(end("strict", more, 1e-12, start), TensorError) << "not without being asked";
  start.init_widen = true;
  EXPECT_NEAR(end("widened", more, 1e-12, start), before, 1e-5 * before);
  start.init = at.folder / "widened" / "weights.safetensors";
  EXPECT_THROW(end("narrow", at.config, 1e-12, start), TensorError) << "nothing is left out";
}

/// Its hold-out counted twice too: what was said of the weights was mostly said of that folder.
TEST(TrainWorld, AFolderThatIsNamedTwiceIsMeasuredOnce) {
  const Prepared at(1);
  const std::filesystem::path shards = at.folder / "shards", more = at.folder / "more";
  WriteSyntheticShards(more, {.clips = 3, .seed = 2});
  CheckpointWeights codec(at.codec());
  EncodeSyntheticShards(nn::Vae(nn::Scope(codec, kCodecPrefix), at.config.vae), more);
  const auto holdout = [&](const char* out, const ShardFolders& folders) {
    WorldOptions options = Quick(1);
    options.job.trainer.learning_rate = 1e-12;
    options.job.trainer.holdout_every = 1;
    options.job.holdout_size = 1000;
    return TrainWorld({folders, at.folder / out, at.config}, options, {at.codec()}, {}).best.value();
  };
  const double once = holdout("once", {shards, more});
  EXPECT_NEAR(holdout("twice", {shards, more, more, shards / ""}), once, 1e-6 * once);
  EXPECT_GT(std::abs(holdout("alone", {shards}) - once), 1e-4 * once) << "or nothing is measured";
}

TEST(TrainWorld, RefusesLatentsOfAnotherCodec) {
  const Prepared at(1);
  WorldStart start{at.codec()};
  start.codec_sha256 = "another";
  EXPECT_THROW(TrainWorld({{at.folder / "shards"}, at.folder / "out", at.config}, Quick(1), start, {}), TensorError);
}

TEST(TrainWorld, DrawsTruthAboveWhatIsImagined) {
  const Prepared at(2);
  WorldOptions options = Quick(2);
  options.job.trainer.holdout_every = 2;
  options.strip_steps = 2;
  int looked = 0;
  TrainWorld({{at.folder / "shards"}, at.folder / "out", at.config}, options, {at.codec()},
             [&](std::int64_t step, const Strips& strips) {
               ++looked;
               EXPECT_EQ(step, 2);
               EXPECT_EQ(strips.picture.size(0), 6 * 2 * 2 * at.config.image_height_px) << "windows, views, two rows";
               EXPECT_GT(strips.psnr.at(0), 0);
             });
  EXPECT_EQ(looked, 1);
}

TEST(Windows, RememberWhatRolloutsRemember) {
  for (const std::int64_t last : {0, 16, 32, 61}) {
    const auto wanted = SparseMemory(static_cast<std::size_t>(4 + last), 4);
    const std::vector<std::int64_t> found = RolloutMemory(last, 4);
    for (std::size_t j = 0; j < 4; ++j) {
      const auto history = static_cast<std::int64_t>(wanted[j]);
      EXPECT_EQ(found[j], history < 4 ? 0 : history - 3) << "the history is frame 0 four times, then 1, 2, …";
    }
  }
}

/// Of a memory of one frame it was the clip's first picture, which the network sees of no other window.
TEST(Windows, ThatAreMeasuredShowWhatIsShownWhenImagining) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.frames = 10});
  const ShardSet shards(folder.path(), Split::kTrain);
  for (const std::int64_t memory : {1, 4}) {
    for (const Window& window : WindowSampler(shards, {.chunk = 3, .memory = memory, .history = 8}).Spread(100))
      EXPECT_EQ(window.image, memory == 1 ? window.last : 0);
  }
}

TEST(Windows, LieInTheirClipNewestLastAndHoldContactWhenAsked) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.frames = 12});
  const ShardSet shards(folder.path(), Split::kTrain);
  const WindowSampler sampler(shards,
                              {.chunk = 3, .memory = 4, .history = 8, .rollout_share = 0.5, .contact_share = 1});
  Dice dice({1, 0, 0, 0}, 1);
  for (int i = 0; i < 200; ++i) {
    const Window window = sampler.Pick(dice);
    EXPECT_TRUE(std::is_sorted(window.memory.begin(), window.memory.end()));
    EXPECT_EQ(window.memory.back(), window.last);
    EXPECT_LT(window.last + 3, window.clip->frames);
    EXPECT_THAT(window.memory, testing::Contains(window.image));
    const Tensor contact = shards.shards()[window.clip->shard].contact;
    EXPECT_GT(contact.narrow(0, window.clip->first + window.last + 1, 3).sum().item<std::int64_t>(), 0);
  }
}

/// Picks only windows in which one clip's hand turns at `turn`: all of those, and where rollouts' chunks begin the one at `chunk_start`.
void ExpectTheTurn(const ShardSet& shards, WindowOptions options, std::int64_t turn, std::int64_t chunk_start) {
  Dice dice({1, 0, 0, 0}, 1);
  std::set<std::int64_t> seen;
  for (const double rollout_share : {0.0, 1.0}) {
    options.rollout_share = rollout_share;
    const WindowSampler sampler(shards, options);
    for (int i = 0; i < 200; ++i) {
      const Window window = sampler.Pick(dice);
      EXPECT_EQ(window.clip->first, 40);
      EXPECT_LE(std::abs(window.last - turn), options.chunk / 2);
      EXPECT_TRUE(rollout_share == 0 || window.last == chunk_start) << window.last;
      seen.insert(window.last);
    }
  }
  EXPECT_EQ(std::ssize(seen), options.chunk) << "every place of it that the options name";
}

TEST(Windows, ShowWhatComesOfAHandThatClosesAndOfOneThatOpensWhenAsked) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.clips = 4, .frames = 40, .closes_at = 9, .opens_at = 25});  // one hand, once
  const ShardSet shards(folder.path(), Split::kTrain);
  ExpectTheTurn(shards, {.chunk = 8, .memory = 4, .history = 8, .closing_share = 1}, 9, 8);
  ExpectTheTurn(shards, {.chunk = 8, .memory = 4, .history = 8, .opening_share = 1}, 25, 24);
}

TEST(Windows, OfHandsThatOpenAreDrawnOfWhatClosingsLeave) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.clips = 4, .frames = 40, .closes_at = 9, .opens_at = 25});
  const ShardSet shards(folder.path(), Split::kTrain);
  const WindowSampler sampler(shards, {.chunk = 8, .memory = 4, .history = 8, .closing_share = 0.5, .opening_share = 1});
  Dice dice({1, 0, 0, 0}, 1);
  int closings = 0;
  constexpr int kPicks = 2000;
  for (int i = 0; i < kPicks; ++i) closings += sampler.Pick(dice).last < 16 ? 1 : 0;
  EXPECT_NEAR(closings, kPicks / 2, 4 * std::sqrt(kPicks) / 2);
}

TEST(Windows, ComeFromSuccessesAloneWhenAsked) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.frames = 12});
  WriteSyntheticShards(folder.path(), {.clips = 6, .frames = 12, .failures = 4});
  const ShardSet shards(folder.path(), Split::kTrain);
  const WindowSampler sampler(shards,
                              {.chunk = 3, .memory = 4, .history = 8, .rollout_share = 0.5, .successes_only = true});
  Dice dice({1, 0, 0, 0}, 1);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(sampler.Pick(dice).clip->outcome, 1);
  WriteSyntheticShards(folder.path(), {.clips = 6, .frames = 12, .failures = 6});
  EXPECT_THROW(WindowSampler(ShardSet(folder.path(), Split::kTrain),
                             {.chunk = 3, .memory = 4, .history = 8, .successes_only = true}),
               TensorError);
}

TEST(Windows, AreOfFailuresAsOftenAsAsked) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.clips = 6, .frames = 12, .failures = 2});
  const ShardSet shards(folder.path(), Split::kTrain);
  const auto failures_of = [&](double weight) {
    const WindowSampler sampler(shards, {.chunk = 3, .memory = 4, .history = 8, .failure_weight = weight});
    Dice dice({1, 0, 0, 0}, 1);
    int failures = 0;
    for (int i = 0; i < 6000; ++i) failures += sampler.Pick(dice).clip->outcome == 0 ? 1 : 0;
    return failures / 6000.0;
  };
  const double plain = failures_of(1), odds = plain / (1 - plain);
  EXPECT_GT(plain, 0.1);
  for (const double weight : {0.5, 3.0}) EXPECT_NEAR(failures_of(weight), weight * odds / (1 + weight * odds), 0.03);
  EXPECT_THROW(WindowSampler(shards, {.chunk = 3, .memory = 4, .history = 8, .failure_weight = 0}), TensorError);
}

TEST(Rays, AreThoseOfTheWorldThatImagines) {
  Eigen::Matrix4f c2w = Eigen::Matrix4f::Identity();
  c2w.block<3, 3>(0, 0) =
      (Eigen::AngleAxisf(0.4F, Eigen::Vector3f::UnitX()) * Eigen::AngleAxisf(-1.1F, Eigen::Vector3f::UnitZ())).matrix();
  c2w.block<3, 1>(0, 3) = Eigen::Vector3f(0.2F, -0.5F, 1.1F);
  Eigen::Matrix3f k;
  k << 80, 0, 50, 0, 75, 30, 0, 0, 1;
  const RayMap wanted = MakeRayMap(ScaledIntrinsics(k, 0.125, 0.125), c2w, 8, 12);
  const Eigen::Matrix<float, 4, 4, Eigen::RowMajor> c2w_rows = c2w;
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> k_rows = k;
  const Rays found = RaysOf(at::from_blob(const_cast<float*>(c2w_rows.data()), {1, 4, 4}, at::kFloat),
                            at::from_blob(const_cast<float*>(k_rows.data()), {1, 3, 3}, at::kFloat), {64, 96}, {8, 12});
  const Tensor direction = at::from_blob(const_cast<float*>(wanted.direction.data()), {3, 8, 12}, at::kFloat);
  EXPECT_LT(nn::LargestDifference(found.direction[0], direction), 1e-6);
  EXPECT_FLOAT_EQ(found.origin[0][1][4][5].item<float>(), -0.5F);
}

}  // namespace
}  // namespace evac::train
