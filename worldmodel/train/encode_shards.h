#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "worldmodel/nn/vae.h"
#include "worldmodel/train/shards.h"

namespace evac::train {

struct EncodeOptions {
  std::string codec;         ///< SHA-256 of its weights, kept in the file
  std::string shard_sha256;  ///< of the shard's file, kept likewise; empty: IsEncoded does not ask
  std::string products = "float32";  ///< what the codec computes with, kept likewise; or "bfloat16"
  /// Of the page, for IsEncoded; empty: not asked. What EncodeShard keeps is its codec's.
  std::optional<double> scale_factor = {};
  at::Device device = at::kCPU;  ///< where the codec's weights are
};

/// Writes a shard's latents beside it (docs/formats/shards.md): the posterior's mean of every picture and map, scaled.
/// The file is there whole or not at all.
void EncodeShard(const nn::Vae& vae, const std::filesystem::path& shard, const EncodeOptions& options);

/// Whether the shard's latents are there and were made so. Those that do not say their scale_factor, as those of
/// earlier versions, count as made with any.
bool IsEncoded(const std::filesystem::path& shard, const EncodeOptions& options);

}  // namespace evac::train
