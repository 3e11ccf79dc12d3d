#include "worldmodel/train/world_batch.h"

#include <ATen/ops/linalg_vector_norm.h>

#include "worldmodel/nn/hand_turns.h"

namespace evac::train {
namespace {

/// The rows of a shard that a window is made of: memory, then chunk.
Tensor RowsOf(const Window& window) {
  std::vector<std::int64_t> rows;
  for (const std::int64_t frame : window.memory) rows.push_back(window.clip->first + frame);
  for (std::int64_t k = 1; k <= window.chunk; ++k) rows.push_back(window.clip->first + window.last + k);
  return at::tensor(rows, at::kLong);
}

/// [T, kTurnRow]
Tensor TurnsOf(const Shard& shard, const Window& window) {
  const std::int64_t oldest = window.memory.front();
  std::vector<std::size_t> frames;
  for (const std::int64_t frame : window.memory) frames.push_back(static_cast<std::size_t>(frame - oldest));
  for (std::int64_t k = 1; k <= window.chunk; ++k) frames.push_back(static_cast<std::size_t>(window.last + k - oldest));
  const Tensor rows = shard.actions.narrow(0, window.clip->first + oldest, window.last + window.chunk + 1 - oldest)
                          .to(at::kFloat)
                          .contiguous();
  const float* numbers = rows.data_ptr<float>();
  const std::vector<float> turns = nn::HandTurns({numbers, numbers + rows.numel()}, frames);
  return at::tensor(turns).reshape({static_cast<std::int64_t>(frames.size()), static_cast<std::int64_t>(nn::kTurnRow)});
}

/// [B][T, V, C, h, w] → [BV, C, T, h, w] floats
Tensor ByView(const std::vector<Tensor>& windows) {
  return at::stack(windows).permute({0, 2, 3, 1, 4, 5}).flatten(0, 1).to(at::kFloat).contiguous();
}

}  // namespace

Rays RaysOf(const Tensor& c2w, const Tensor& k, const std::vector<std::int64_t>& picture_px,
            const std::vector<std::int64_t>& latent_px) {
  const std::int64_t n = c2w.size(0), h = latent_px[0], w = latent_px[1];
  const double y_factor = static_cast<double>(h) / static_cast<double>(picture_px[0]);
  const double x_factor = static_cast<double>(w) / static_cast<double>(picture_px[1]);
  const auto entry = [&](std::int64_t row, std::int64_t column, double factor) {
    return (k.select(1, row).select(1, column) * factor).reshape({n, 1, 1});
  };
  const Tensor x = (at::arange(w, at::kFloat) + 0.5).reshape({1, 1, w}), y = (at::arange(h, at::kFloat) + 0.5).reshape({1, h, 1});
  const Tensor across = ((x - entry(0, 2, x_factor)) / entry(0, 0, x_factor)).expand({n, h, w});
  const Tensor down = ((y - entry(1, 2, y_factor)) / entry(1, 1, y_factor)).expand({n, h, w});
  const Tensor in_camera = at::stack({across, down, at::ones({n, h, w})}, 1).flatten(2);  // [N, 3, h w]
  const Tensor in_base = at::matmul(c2w.narrow(1, 0, 3).narrow(2, 0, 3), in_camera);
  const Tensor length = at::linalg_vector_norm(in_base, 2, at::IntArrayRef{1}, true);
  const Tensor origin = c2w.narrow(1, 0, 3).select(2, 3).reshape({n, 3, 1, 1}).expand({n, 3, h, w});
  return {(in_base / length).reshape({n, 3, h, w}), origin};
}

WorldBatch WorldBatch::To(at::Device device) const {
  WorldBatch moved = *this;
  for (Tensor WorldBatch::*tensor : {&WorldBatch::latents, &WorldBatch::pose_maps, &WorldBatch::direction,
                                     &WorldBatch::origin, &WorldBatch::images, &WorldBatch::deltas, &WorldBatch::arms,
                                     &WorldBatch::turns, &WorldBatch::object})
    moved.*tensor = (moved.*tensor).to(device);
  return moved;
}

WorldBatch MakeWorldBatch(const ShardSet& shards, const std::vector<Window>& windows) {
  const Window& first = windows.front();
  const auto memory = static_cast<std::int64_t>(first.memory.size());
  const std::int64_t chunk = first.chunk;
  const std::int64_t views = shards.views(), height = shards.height_px(), width = shards.width_px();
  WorldBatch batch{static_cast<std::int64_t>(windows.size()), views, memory, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  std::vector<Tensor> latents, maps, directions, origins, images, deltas, arms, turns, objects;
  for (const Window& window : windows) {
    const Shard& shard = shards.shards()[window.clip->shard];
    const Tensor rows = RowsOf(window);
    latents.push_back(shard.latents.index_select(0, rows));
    maps.push_back(shard.map_latents.index_select(0, rows));
    const Rays rays = RaysOf(shard.c2w.index_select(0, rows).flatten(0, 1), shard.k.index_select(0, rows).flatten(0, 1),
                             {height, width}, {latents.back().size(3), latents.back().size(4)});
    directions.push_back(rays.direction.unflatten(0, {memory + chunk, views}));
    origins.push_back(rays.origin.unflatten(0, {memory + chunk, views}));
    images.push_back(PicturesFrom(shard.frames[window.clip->first + window.image]));
    deltas.push_back(shard.deltas.narrow(0, window.clip->first + window.last + 1, chunk));
    arms.push_back(shard.actions.index_select(0, rows));
    turns.push_back(TurnsOf(shard, window));
    objects.push_back(shard.object_px.index_select(0, rows));
  }
  batch.latents = ByView(latents);
  batch.pose_maps = ByView(maps);
  batch.pose_maps.narrow(2, 0, memory).zero_();
  batch.direction = ByView(directions);
  batch.origin = ByView(origins);
  batch.images = at::cat(images);
  batch.deltas = at::stack(deltas);
  batch.arms = at::stack(arms);
  batch.turns = at::stack(turns);
  const double per_px = static_cast<double>(batch.latents.size(4)) / static_cast<double>(width);
  batch.object = at::stack(objects).permute({0, 2, 3, 1}).flatten(0, 1) * per_px;
  return batch;
}

}  // namespace evac::train
