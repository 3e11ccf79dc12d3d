#include "apps/networks/shard_codec.h"

#include "worldmodel/nn/pictures.h"
#include "worldmodel/train/sha256.h"

namespace evac {

ShardCodec::ShardCodec(const std::filesystem::path& weights, const nn::VaeConfig& config)
    : path_(weights), config_(config), weights_(weights), vae_(nn::Scope(weights_, train::kCodecPrefix), config) {}

void ShardCodec::Open(train::ShardSet& shards) const {
  shards.OpenLatents(config_.z_channels, config_.Stride(), config_.scale_factor);
  if (shards.codec() != train::CodecSha256(path_))
    throw TensorError(path_.string() + " did not make the shards' latents (they are of codec " + shards.codec() +
                      "): wanted `evac encode` with this codec");
}

at::Tensor ShardCodec::Reconstructed(const train::Shard& shard, const std::vector<std::int64_t>& rows) const {
  const at::NoGradGuard no_gradients;
  const at::Tensor latents = shard.latents.index_select(0, at::tensor(at::ArrayRef<std::int64_t>(rows)));
  const at::Tensor pictures = vae_.Decode(latents.flatten(0, 1).to(at::kFloat));  // [T V, 3, H, W]
  return nn::ToBytes(pictures)
      .permute({0, 2, 3, 1})
      .unflatten(0, {latents.size(0), latents.size(1)})
      .transpose(0, 1)
      .contiguous();
}

}  // namespace evac
