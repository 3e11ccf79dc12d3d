#pragma once

#include <filesystem>
#include <string>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "tests/train/synthetic_shards.h"
#include "worldmodel/train/train_codec.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {

inline nn::ModelConfig SmallConfig(std::int64_t views) {
  nn::ModelConfig config = nn::TinyConfig();
  config.vae.channel_mult = {1, 1, 1};
  config.vae.patch_px = 1;
  config.unet.channel_mult = {1, 1};
  config.vae.scale_factor = 1;
  config.views = views;
  return config;
}

/// Shards, a codec and its latents: where the training of a world model begins.
struct Prepared {
  explicit Prepared(std::int64_t views, std::int64_t frames = 9)
      : Prepared(SyntheticShards{.frames = frames, .views = views}) {}
  explicit Prepared(const SyntheticShards& shards) : config(SmallConfig(shards.views)) {
    WriteSyntheticShards(folder / "shards", shards);
    CodecOptions options;
    options.job.trainer.steps = 2;
    options.job.trainer.learning_rate = 1e-3;
    options.codec.batch = 4;
    TrainCodec({{folder / "shards"}, folder / "codec", config}, options);
    Encode("float32");
  }
  /// The latents anew, otherwise computed.
  void Encode(const std::string& products) const {
    CheckpointWeights weights(codec());
    EncodeSyntheticShards(nn::Vae(nn::Scope(weights, kCodecPrefix), config.vae), folder / "shards", products);
  }
  std::filesystem::path codec() const { return folder / "codec" / "codec.safetensors"; }

  TempFolder folder;
  nn::ModelConfig config;
};

/// So many steps on very little.
inline WorldOptions Quick(std::int64_t steps) {
  WorldOptions options;
  options.job.trainer.steps = steps;
  options.job.trainer.learning_rate = 3e-3;
  options.job.trainer.clip_norm = 1;
  options.job.holdout_size = 6;
  options.world.batch = 4;
  options.world.windows.history = 6;
  options.world.drop = 0;
  return options;
}

}  // namespace evac::train
