#include "worldmodel/train/strips.h"

#include <ATen/ops/ones_like.h>
#include <ATen/ops/zeros_like.h>

#include <algorithm>
#include <cmath>

#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/pictures.h"

namespace evac::train {
namespace {

enum Stream : std::uint32_t { kStart = 21, kSteps };

/// Latents [V, z, K, h, w] as pictures [V K, 3, H, W] in [-1, 1], on the CPU.
Tensor Pictures(const nn::EvacModel& model, const Tensor& latents) {
  return nn::DecodeLatents(model, latents.transpose(1, 2).flatten(0, 1)).clamp(-1, 1).cpu();
}

/// What one window's chunk looks like to the network: [V K, 3, H, W] in [-1, 1].
Tensor Imagine(const nn::EvacModel& model, const WorldBatch& batch, const StripOptions& options, std::int64_t index) {
  const std::int64_t n = batch.memory, chunk = batch.latents.size(2) - n;
  Dice start({options.seed, index, 0, 0}, kStart), steps({options.seed, index, 0, 0}, kSteps);
  const nn::ChunkRequest request{batch.latents.narrow(2, 0, n),
                                 batch.images,
                                 batch.pose_maps.narrow(2, n, chunk),
                                 batch.direction,
                                 batch.origin,
                                 batch.deltas,
                                 batch.arms,
                                 batch.turns};
  std::vector<std::int64_t> shape = batch.latents.sizes().vec();
  const auto step = [&] { return steps.Normal(batch.latents.sizes()).to(options.device); };
  shape[2] = chunk;
  nn::ImagineOptions sampler;
  sampler.solver = nn::Solver::kDpmSolver;
  sampler.steps = options.steps;
  const Tensor latents = nn::ImagineChunk(model, request, {start.Normal(shape).to(options.device), step}, sampler);
  return Pictures(model, latents.narrow(2, n, chunk));
}

/// The chunk in which nothing changes, as the network is told.
Tensor NothingChanges(const nn::EvacModel& model, const WorldBatch& batch) {
  nn::Concat concat{{}, at::ones_like(batch.latents.narrow(1, 0, 1)), {}, batch.direction, batch.origin};
  nn::Remember(model, batch.latents.narrow(2, 0, batch.memory), concat);
  return Pictures(model, concat.still);
}

/// The frames from the newest memory on: [V (1 + K), 3, H, W].
Tensor Truth(const ShardSet& shards, const Window& window) {
  const Tensor frames =
      shards.shards()[window.clip->shard].frames.narrow(0, window.clip->first + window.last, window.chunk + 1);
  return PicturesFrom(frames.transpose(0, 1).flatten(0, 1));
}

/// Per view. @param a, b  [V, K, 3, H, W] in [-1, 1]
Tensor SquaredErrors(const Tensor& a, const Tensor& b) { return ((a - b) / 2).square().flatten(1).mean(1); }

std::vector<double> Psnr(const Tensor& errors) {
  std::vector<double> decibel;
  for (std::int64_t view = 0; view < errors.size(0); ++view)
    decibel.push_back(-10 * std::log10(std::max(errors[view].item<double>(), 1e-12)));
  return decibel;
}

/// [F, 3, H, W] → [H, some W, 3]
Tensor Row(const Tensor& frames, std::int64_t every) {
  std::vector<Tensor> drawn;
  for (std::int64_t i = 0; i < frames.size(0); i += every) drawn.push_back(nn::ToBytes(frames[i]).permute({1, 2, 0}));
  return at::cat(drawn, 1);
}

}  // namespace

Strips DrawStrips(const nn::EvacModel& model, const ShardSet& shards, const std::vector<Window>& windows,
                  const StripOptions& options) {
  const at::NoGradGuard no_gradients;
  std::vector<Tensor> rows;
  const bool carries = model.schedule().carry_plane_m().has_value();
  Tensor error = at::zeros({model.config().views}), copy_error = at::zeros_like(error),
         carried_error = at::zeros_like(error);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const WorldBatch batch = MakeWorldBatch(shards, {windows[i]}).To(options.device);
    const std::int64_t views = batch.views, chunk = windows[i].chunk;
    const Tensor truth = Truth(shards, windows[i]).unflatten(0, {views, chunk + 1});
    const Tensor imagined = Imagine(model, batch, options, static_cast<std::int64_t>(i)).unflatten(0, {views, chunk});
    const Tensor newest = truth.narrow(1, 0, 1);
    error += SquaredErrors(imagined, truth.narrow(1, 1, chunk));
    copy_error += SquaredErrors(newest.expand(imagined.sizes()), truth.narrow(1, 1, chunk));
    if (carries)
      carried_error +=
          SquaredErrors(NothingChanges(model, batch).unflatten(0, {views, chunk}), truth.narrow(1, 1, chunk));
    for (std::int64_t view = 0; view < views; ++view) {
      rows.push_back(Row(truth[view], options.every));
      rows.push_back(Row(at::cat({newest[view], imagined[view]}), options.every));
    }
  }
  const auto count = static_cast<double>(windows.size());
  return {at::cat(rows).contiguous(), Psnr(error / count), Psnr(copy_error / count),
          carries ? Psnr(carried_error / count) : std::vector<double>()};
}

}  // namespace evac::train
