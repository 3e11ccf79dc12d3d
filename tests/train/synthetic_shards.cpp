#include "tests/train/synthetic_shards.h"

#include <ATen/ops/eye.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "core/hash.h"
#include "worldmodel/train/dice.h"
#include "worldmodel/train/encode_shards.h"

namespace evac::train {
namespace {

struct Tensors {
  Tensor clip_start, clip_id, crop, task, outcome, frames, maps, actions, deltas, c2w, k, object_px, contact;
};

Tensors Empty(const SyntheticShards& o) {
  const std::int64_t f = o.clips * o.frames, v = o.views;
  Tensors t;
  t.clip_start = at::arange(o.clips + 1, at::kLong) * o.frames;
  t.clip_id = at::arange(o.clips, at::kLong);
  t.crop = at::zeros({o.clips, 4}, at::kInt);
  t.task = at::zeros({o.clips}, at::kInt);
  t.outcome = (at::arange(o.clips) >= o.failures).to(at::kChar);
  t.frames = at::zeros({f, v, o.height_px, o.width_px, 3}, at::kByte);
  t.maps = at::full({f, v, o.height_px, o.width_px, 3}, 50, at::kByte);
  t.actions = at::zeros({f, 16});
  t.deltas = at::zeros({f, 14});
  t.c2w = at::zeros({f, v, 4, 4});
  t.k = at::zeros({f, v, 3, 3});
  t.object_px = at::zeros({f, v, 2});
  t.contact = at::zeros({f}, at::kByte);
  return t;
}

/// What one row shows: a square of 6 pixels about (x, y).
void Draw(const SyntheticShards& o, const Tensors& t, std::int64_t row, const std::array<double, 3>& x_y_ground) {
  const auto x = static_cast<std::int64_t>(x_y_ground[0]), y = static_cast<std::int64_t>(x_y_ground[1]);
  for (std::int64_t v = 0; v < o.views; ++v) {
    t.frames[row][v].fill_(x_y_ground[2] + 20 * static_cast<double>(v));
    t.frames[row][v].narrow(0, y - 3, 6).narrow(1, x - 3, 6).select(2, 0).fill_(230);
    t.maps[row][v].narrow(0, y - 2, 4).narrow(1, x - 2, 4).select(2, 1).fill_(250);
    t.object_px[row][v][0] = static_cast<double>(x);
    t.object_px[row][v][1] = static_cast<double>(y);
    t.c2w[row][v].copy_(at::eye(4));
    t.c2w[row][v][2][3] = -1.0;
    t.k[row][v].copy_(at::eye(3) * 20);
    t.k[row][v][0][2] = static_cast<double>(o.width_px) / 2;
    t.k[row][v][1][2] = static_cast<double>(o.height_px) / 2;
    t.k[row][v][2][2] = 1;
  }
}

void Fill(const SyntheticShards& o, const Tensors& t, Dice& dice) {
  t.task.fill_(o.task);
  for (std::int64_t clip = 0; clip < o.clips; ++clip) {
    double x = dice.Uniform(4, static_cast<double>(o.width_px) - 4), y = dice.Uniform(4, static_cast<double>(o.height_px) - 4);
    const double ground = dice.Uniform(20, 150);
    for (std::int64_t i = 0; i < o.frames; ++i) {
      const std::int64_t row = clip * o.frames + i;
      const double before_x = x, before_y = y;
      if (i > 0) x = std::clamp(x + dice.Uniform(-o.step_px, o.step_px), 4.0, static_cast<double>(o.width_px) - 4);
      if (i > 0) y = std::clamp(y + dice.Uniform(-o.step_px, o.step_px), 4.0, static_cast<double>(o.height_px) - 4);
      t.deltas[row][7] = (x - before_x) / 2;
      t.deltas[row][8] = (y - before_y) / 2;
      const bool has_opened = o.opens_at > 0 && i >= o.opens_at;
      t.actions[row][15] = clip == 1 && o.closes_at > 0 && i >= o.closes_at && !has_opened ? 120 : 0;
      t.contact[row] = i == o.frames / 2 ? 1 : 0;
      Draw(o, t, row, {x, y, ground});
      if (o.views > 1) t.c2w[row][1][0][3] = static_cast<double>(i % 2) * o.wrist_swing_m;
      if (!o.knows_object) t.object_px[row].fill_(std::nan(""));
    }
  }
}

void Write(const std::filesystem::path& path, const Tensors& t, const TensorMetadata& metadata) {
  const TensorView views[] = {
      nn::ViewOf("clip_start", t.clip_start), nn::ViewOf("clip_id", t.clip_id), nn::ViewOf("crop", t.crop),
      nn::ViewOf("task", t.task),             nn::ViewOf("outcome", t.outcome), nn::ViewOf("frames", t.frames),
      nn::ViewOf("maps", t.maps),             nn::ViewOf("actions", t.actions), nn::ViewOf("deltas", t.deltas),
      nn::ViewOf("c2w", t.c2w),               nn::ViewOf("k", t.k),             nn::ViewOf("object_px", t.object_px),
      nn::ViewOf("contact", t.contact)};
  WriteTensorFile(path, views, metadata);
}

}  // namespace

void WriteSyntheticShards(const std::filesystem::path& folder, const SyntheticShards& options) {
  std::filesystem::create_directories(folder);
  std::string list;
  for (const int index : {0, 1}) {
    Dice dice({options.seed, index, 0, 0}, 99);
    const Tensors tensors = Empty(options);
    Fill(options, tensors, dice);
    TensorMetadata metadata = {{"format", "evac-shard"},
                               {"version", "1"},
                               {"split", index == 0 ? "train" : "holdout"},
                               {"period_s", "0.1"},
                               {"height_px", std::to_string(options.height_px)},
                               {"width_px", std::to_string(options.width_px)},
                               {"cameras", options.views == 1 ? "head" : "head,hand_right"},
                               {"arms", "right"},
                               {"tasks", options.tasks},
                               {"pose_map", "radius_px=50 thickness_px=8"},
                               {"delta_frames", "3"},
                               {"statistics", options.statistics},
                               {"recipe", std::to_string(options.seed)},
                               {"shard", std::to_string(index)},
                               {"shards", "2"}};
    if (*options.arms_read != '\0') metadata["arms_read"] = options.arms_read;
    const std::string name = "shard_0000" + std::to_string(index) + ".safetensors";
    Write(folder / name, tensors, metadata);
    if (index > 0) list += ", ";
    list += "{\"file\": \"" + name + "\", \"sha256\": \"" + Sha256HexOfFile(folder / name) + "\"}";
  }
  std::ofstream(folder / "shards.json") << "{\"shards\": [" << list << "]}\n";
}

void ChangeSyntheticShard(const std::filesystem::path& folder,
                          const std::function<void(const std::string& name, Tensor& tensor)>& change,
                          const TensorMetadata& metadata) {
  const std::filesystem::path path = folder / "shard_00000.safetensors";
  const nn::MappedTensors file(TensorFile::Open(path));
  std::vector<Tensor> tensors;
  std::vector<TensorView> views;
  for (const TensorView& view : file.file().tensors()) {
    Tensor tensor = file.Get(view.name).clone();
    change(view.name, tensor);
    tensors.push_back(tensor.contiguous());
    views.push_back(nn::ViewOf(view.name, tensors.back()));
  }
  TensorMetadata all = metadata;
  all.insert(file.file().metadata().begin(), file.file().metadata().end());  // what is said already stays
  WriteTensorFile(path, views, all);
}

void EncodeSyntheticShards(const nn::Vae& vae, const std::filesystem::path& folder, const std::string& products) {
  for (const std::filesystem::path& shard : ShardPaths(folder))
    EncodeShard(vae, shard, {"codec", Sha256HexOfFile(shard), products});
}

}  // namespace evac::train
