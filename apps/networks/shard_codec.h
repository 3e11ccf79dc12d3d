#pragma once

#include <filesystem>
#include <vector>

#include "worldmodel/nn/vae.h"
#include "worldmodel/train/shards.h"
#include "worldmodel/train/weight_files.h"

namespace evac {

/// The codec whose latents lie beside shards: shows recordings as a world model would draw them, were it never wrong.
class ShardCodec {
 public:
  /// @param weights  of the codec, alone or in a checkpoint
  ShardCodec(const std::filesystem::path& weights, const nn::VaeConfig& config);

  /// Opens the latents of shards that are to be reconstructed. @throws TensorError if they are another codec's
  void Open(train::ShardSet& shards) const;
  /// [V, T, H, W, 3] bytes of some rows of a shard whose latents are open.
  at::Tensor Reconstructed(const train::Shard& shard, const std::vector<std::int64_t>& rows) const;

 private:
  std::filesystem::path path_;
  nn::VaeConfig config_;
  train::CheckpointWeights weights_;
  nn::Vae vae_;
};

}  // namespace evac
