#include "worldmodel/train/imagine_shards.h"

#include <algorithm>

#include "worldmodel/nn/imagine.h"
#include "worldmodel/train/world_batch.h"

namespace evac::train {
namespace {

enum Stream : std::uint32_t { kStart = 31 };

/// A clip on its way.
struct Rollout {
  const Clip* clip;
  Tensor latents;         ///< [frames, V, z, h, w]
  std::int64_t done = 0;  ///< frames 0 … done are there
};

Window WindowOf(const Rollout& rollout, const nn::ModelConfig& config) {
  const std::int64_t last = std::min(rollout.done, rollout.clip->frames - 1 - config.chunk);
  Window window{rollout.clip, RolloutMemory(last, config.memory), last, config.chunk, 0};
  window.image = window.memory.front();
  return window;
}

/// What is remembered is what was imagined. [BV, z, N, h, w]
Tensor MemoryOf(const std::vector<Rollout*>& rollouts, const std::vector<Window>& windows) {
  std::vector<Tensor> memories;
  for (std::size_t i = 0; i < rollouts.size(); ++i)
    memories.push_back(rollouts[i]->latents.index_select(0, at::tensor(windows[i].memory, at::kLong)).permute({1, 2, 0, 3, 4}));
  return at::cat(memories).contiguous();
}

/// With a memory of one frame the image encoder sees that one too, and beyond the first it was imagined.
void ShowWhatWasImagined(const nn::EvacModel& model, const std::vector<Rollout*>& rollouts,
                         const std::vector<Window>& windows, WorldBatch& batch) {
  for (std::size_t i = 0; i < rollouts.size(); ++i) {
    if (windows[i].image == 0) continue;
    batch.images.narrow(0, static_cast<std::int64_t>(i) * batch.views, batch.views)
        .copy_(nn::PicturesShown(model, rollouts[i]->latents[windows[i].image]));
  }
}

/// Noise of each scene by itself: [BV, z, K, h, w].
Tensor NoiseOf(const std::vector<Window>& windows, const std::vector<std::int64_t>& one_scene, std::uint64_t seed) {
  std::vector<Tensor> noises;
  for (const Window& window : windows) {
    const auto shard = static_cast<std::int64_t>(window.clip->shard);
    noises.push_back(Dice({seed, window.clip->first + window.last, shard, 0}, kStart).Normal(one_scene));
  }
  return at::cat(noises);
}

/// The next chunk of all of them.
void Advance(const nn::EvacModel& model, const ShardSet& shards, const std::vector<Rollout*>& rollouts,
             const ImagineOptions& options) {
  const nn::ModelConfig& config = model.config();
  std::vector<Window> windows;
  for (const Rollout* rollout : rollouts) windows.push_back(WindowOf(*rollout, config));
  WorldBatch batch = MakeWorldBatch(shards, windows);
  ShowWhatWasImagined(model, rollouts, windows, batch);
  const nn::ChunkRequest request{MemoryOf(rollouts, windows),
                                 batch.images,
                                 batch.pose_maps.narrow(2, config.memory, config.chunk),
                                 batch.direction,
                                 batch.origin,
                                 batch.deltas,
                                 batch.arms,
                                 batch.turns};
  const std::vector<std::int64_t> one_scene = {batch.views, batch.latents.size(1), config.chunk, batch.latents.size(3),
                                               batch.latents.size(4)};
  nn::ImagineOptions sampler;
  sampler.solver = nn::Solver::kDpmSolver;
  sampler.steps = options.steps;
  const Tensor imagined =
      nn::ImagineChunk(model, request, {NoiseOf(windows, one_scene, options.seed), {}}, sampler)
          .narrow(2, config.memory, config.chunk)
          .unflatten(0, {static_cast<std::int64_t>(rollouts.size()), batch.views});  // [B, V, z, K, h, w]
  for (std::size_t i = 0; i < rollouts.size(); ++i) {
    rollouts[i]->latents.narrow(0, windows[i].last + 1, config.chunk)
        .copy_(imagined[static_cast<std::int64_t>(i)].permute({2, 0, 1, 3, 4}));
    rollouts[i]->done = windows[i].last + config.chunk;
  }
}

/// A shard's clips with their numbers among all of its.
struct LongEnough {
  std::vector<Clip> clips;
  std::vector<std::int64_t> numbers;
};

LongEnough LongEnoughOf(const ShardSet& shards, std::size_t index, std::int64_t chunk) {
  LongEnough found;
  std::int64_t number = 0;
  for (const Clip& clip : shards.clips()) {
    if (clip.shard != index) continue;
    if (clip.frames > chunk) {
      found.clips.push_back(clip);
      found.numbers.push_back(number);
    }
    ++number;
  }
  return found;
}

/// What is no number, or none that a half holds, would be learned from: a judge's weights are no numbers then.
void RequireNumbers(const Tensor& latents, const std::filesystem::path& shard, std::int64_t clip) {
  const Tensor wrong = latents.to(at::kFloat).isfinite().logical_not();
  if (!wrong.any().item<bool>()) return;
  throw TensorError(shard.string() + ": " + std::to_string(wrong.sum().item<std::int64_t>()) + " of " +
                    std::to_string(wrong.numel()) + " numbers of what is imagined of clip " + std::to_string(clip) +
                    " are not finite, wanted numbers that a half holds");
}

}  // namespace

std::vector<Tensor> ImagineClips(const nn::EvacModel& model, const ShardSet& shards, const std::vector<Clip>& clips,
                                 const ImagineOptions& options) {
  const at::NoGradGuard no_gradients;
  std::vector<Rollout> rollouts;
  for (const Clip& clip : clips) {
    const Shard& shard = shards.shards()[clip.shard];
    if (clip.frames <= model.config().chunk)
      throw TensorError(shard.path.string() + ": a clip of " + std::to_string(clip.frames) + " frames, wanted " +
                        std::to_string(model.config().chunk + 1) + " at least");
    rollouts.push_back({&clip, shard.latents.narrow(0, clip.first, clip.frames).to(at::kFloat)});
  }
  for (std::size_t from = 0; from < rollouts.size(); from += static_cast<std::size_t>(options.batch)) {
    const std::size_t to = std::min(rollouts.size(), from + static_cast<std::size_t>(options.batch));
    while (true) {
      std::vector<Rollout*> going;
      for (std::size_t i = from; i < to; ++i) {
        if (rollouts[i].done + 1 < rollouts[i].clip->frames) going.push_back(&rollouts[i]);
      }
      if (going.empty()) break;
      Advance(model, shards, going, options);
    }
  }
  std::vector<Tensor> imagined;
  for (const Rollout& rollout : rollouts) imagined.push_back(rollout.latents);
  return imagined;
}

void WriteImaginedLatents(const nn::EvacModel& model, const ShardSet& shards, std::size_t index,
                          const std::filesystem::path& folder, const std::string& products,
                          const ImagineOptions& options) {
  const Shard& shard = shards.shards().at(index);
  const auto [clips, numbers] = LongEnoughOf(shards, index, model.config().chunk);
  const Tensor latents = shard.latents.clone();
  const std::vector<Tensor> imagined = ImagineClips(model, shards, clips, options);
  for (std::size_t i = 0; i < clips.size(); ++i)
    RequireNumbers(latents.narrow(0, clips[i].first, clips[i].frames).copy_(imagined[i]), shard.path, numbers[i]);
  TensorMetadata metadata = TensorFile::Open(LatentsPath(shard.path)).metadata();
  metadata["products"] = products;
  const Tensor maps = shard.map_latents.contiguous();
  const TensorView views[] = {nn::ViewOf("latents", latents), nn::ViewOf("map_latents", maps)};
  WriteTensorFile(folder / LatentsPath(shard.path).filename(), views, metadata);
}

}  // namespace evac::train
