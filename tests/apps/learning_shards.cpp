#include "tests/apps/learning_shards.h"

#include <nlohmann/json.hpp>
#include <string>

#include "core/file.h"
#include "core/hash.h"
#include "core/seed.h"
#include "worldmodel/nn/tensor.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/sha256.h"
#include "worldmodel/train/train_codec.h"
#include "worldmodel/train/weight_files.h"

namespace evac {
namespace {

using at::Tensor;

struct Tensors {
  Tensor clip_start, clip_id, crop, task, outcome, frames, maps, actions, deltas, c2w, k, object_px, contact;
};

Tensors Empty(const LearningShards& o, std::int64_t first_id) {
  const std::int64_t f = o.clips * o.frames;
  Tensors t;
  t.clip_start = at::arange(o.clips + 1, at::kLong) * o.frames;
  t.clip_id = at::arange(o.clips, at::kLong) + first_id;
  t.crop = at::zeros({o.clips, 4}, at::kInt);
  t.task = at::zeros({o.clips}, at::kInt);
  t.outcome = at::zeros({o.clips}, at::kChar);
  t.frames = at::zeros({f, 2, o.height_px, o.width_px, 3}, at::kByte);
  t.maps = at::zeros({f, 2, o.height_px, o.width_px, 3}, at::kByte);
  t.actions = at::zeros({f, 16});
  t.deltas = at::zeros({f, 14});
  t.c2w = at::zeros({f, 2, 4, 4});
  t.k = at::zeros({f, 2, 3, 3});
  t.object_px = at::zeros({f, 2, 2});
  t.contact = at::zeros({f}, at::kByte);
  return t;
}

/// Both cameras look straight down from a metre above.
void PutCameras(const LearningShards& o, const Tensors& t, std::int64_t row) {
  for (std::int64_t v = 0; v < 2; ++v) {
    const Tensor pose = t.c2w[row][v], k = t.k[row][v];
    pose[0][0] = pose[3][3] = 1;
    pose[1][1] = pose[2][2] = -1;
    pose[0][3] = 0.4;
    pose[2][3] = 1;
    k[0][0] = k[1][1] = static_cast<double>(o.width_px);
    k[0][2] = static_cast<double>(o.width_px) / 2;
    k[1][2] = static_cast<double>(o.height_px) / 2;
    k[2][2] = 1;
  }
}

/// @param part  how far the arm is on its way, 0 to 1
void Draw(const LearningShards& o, const Tensors& t, std::int64_t row, double part, std::int64_t y, bool success) {
  const double reach = static_cast<double>(o.width_px) - 8;
  const auto x = static_cast<std::int64_t>(4 + (success ? part : 0) * reach);
  for (std::int64_t v = 0; v < 2; ++v) {
    const Tensor picture = t.frames[row][v];
    picture.fill_(60 + 20 * static_cast<double>(v));
    picture.narrow(0, 0, 2).narrow(1, static_cast<std::int64_t>(part * reach), 4).fill_(10);  // the arm, either way
    picture.narrow(0, y - 2, 4).narrow(1, x - 2, 4).select(2, 0).fill_(240);
    t.object_px[row][v][0] = static_cast<double>(x);
    t.object_px[row][v][1] = static_cast<double>(y);
  }
  PutCameras(o, t, row);
  const Tensor arm = t.actions[row].narrow(0, 8, 8);
  arm[0] = 0.3 + 0.2 * part;
  arm[2] = 0.1;
  arm[3] = 1;  // half a turn about x: pointing down
  arm[7] = part > 0.3 && part < 0.8 ? 120 : 0;
  t.contact[row] = part > 0.2 && part < 0.4 ? 1 : 0;
}

void Write(const std::filesystem::path& path, const LearningShards& o, const Tensors& t, bool holds_out) {
  const TensorView views[] = {nn::ViewOf("clip_start", t.clip_start),
                              nn::ViewOf("clip_id", t.clip_id),
                              nn::ViewOf("crop", t.crop),
                              nn::ViewOf("task", t.task),
                              nn::ViewOf("outcome", t.outcome),
                              nn::ViewOf("frames", t.frames),
                              nn::ViewOf("maps", t.maps),
                              nn::ViewOf("actions", t.actions),
                              nn::ViewOf("deltas", t.deltas),
                              nn::ViewOf("c2w", t.c2w),
                              nn::ViewOf("k", t.k),
                              nn::ViewOf("object_px", t.object_px),
                              nn::ViewOf("contact", t.contact)};
  WriteTensorFile(path, views,
                  {{"format", "evac-shard"},
                   {"version", "1"},
                   {"split", holds_out ? "holdout" : "train"},
                   {"period_s", "0.1"},
                   {"height_px", std::to_string(o.height_px)},
                   {"width_px", std::to_string(o.width_px)},
                   {"cameras", "head,hand_right"},
                   {"arms", "right"},
                   {"tasks", "carry"},
                   {"pose_map", "radius_px=3 thickness_px=1"},  // of this height, scaled
                   {"delta_frames", "3"},
                   {"statistics", "synthetic"},
                   {"recipe", "carry"},
                   {"shard", holds_out ? "1" : "0"},
                   {"shards", "2"}});
}

}  // namespace

void WriteLearningShards(const std::filesystem::path& folder, const LearningShards& options) {
  MakeFolders(folder);
  nlohmann::json states = nlohmann::json::array(), behaviours = states, fates = states, shards = states;
  SplitMix64 random(1);
  for (const bool holds_out : {false, true}) {
    const Tensors tensors = Empty(options, holds_out ? options.clips : 0);
    for (std::int64_t clip = 0; clip < options.clips; ++clip) {
      const bool success = clip % 2 == 0;
      tensors.outcome[clip] = !options.knows_outcome ? -1 : success ? 1 : 0;
      const auto y = 4 + static_cast<std::int64_t>(random.Below(static_cast<std::uint64_t>(options.height_px) - 7));
      for (std::int64_t i = 0; i < options.frames; ++i)
        Draw(options, tensors, clip * options.frames + i,
             static_cast<double>(i) / static_cast<double>(options.frames - 1), y, success);
      states.push_back((holds_out ? "unseen-" : "seen-") + std::to_string(clip / 2));
      behaviours.push_back(options.behaviour);
      fates.push_back(success ? "success" : "near_miss");
    }
    const std::string name = holds_out ? "shard_00001.safetensors" : "shard_00000.safetensors";
    Write(folder / name, options, tensors, holds_out);
    shards.push_back({{"file", name}, {"sha256", Sha256HexOfFile(folder / name)}});
  }
  const nlohmann::json page = {{"states", states}, {"behaviours", behaviours}, {"fates", fates}, {"shards", shards}};
  WriteFileAtomically(folder / "shards.json", page.dump());
}

nn::VaeConfig LearningCodec() {
  return {
      .channels = 32, .channel_mult = {1, 1}, .num_res_blocks = 1, .z_channels = 8, .scale_factor = 1, .patch_px = 2};
}

std::filesystem::path EncodeLearningShards(const std::filesystem::path& folder, const std::filesystem::path& out) {
  train::CodecOptions options;
  options.job.trainer.steps = 60;
  options.job.trainer.learning_rate = 5e-3;
  options.job.trainer.clip_norm = 1;
  options.codec.batch = 8;
  train::JobPlace place;
  place.shards = {folder};
  place.out = out;
  place.config.vae = LearningCodec();
  place.config.views = 2;
  place.config.image_height_px = 16;
  place.config.image_width_px = 24;
  train::TrainCodec(place, options);
  const std::filesystem::path codec = out / "codec.safetensors";
  train::CheckpointWeights weights(codec);
  const nn::Vae vae(nn::Scope(weights, train::kCodecPrefix), place.config.vae);
  for (const auto& shard : train::ShardPaths(folder))
    train::EncodeShard(vae, shard, {train::CodecSha256(codec), Sha256HexOfFile(shard)});
  return codec;
}

}  // namespace evac
