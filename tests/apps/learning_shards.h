#pragma once

#include <cstdint>
#include <filesystem>

#include "worldmodel/nn/vae.h"

namespace evac {

/// A packing that is small enough to learn from in a test. A bright square, the object, either goes from left to right
/// while the arm takes it there (success), or stays on the left while the arm does the same (failure). Two views, one
/// task. Nothing but the square tells the two apart.
struct LearningShards {
  std::int64_t clips = 24;  ///< of each split, every second a success; two to an initial state
  std::int64_t frames = 20;
  std::int64_t height_px = 16, width_px = 24;
  const char* behaviour = "good";
  bool knows_outcome = true;  ///< as a collection's shards; those of a robot's recordings do not
};

/// Writes a training and a hold-out shard and shards.json, as docs/formats/shards.md says.
void WriteLearningShards(const std::filesystem::path& folder, const LearningShards& options);

/// The codec that EncodeLearningShards trains.
nn::VaeConfig LearningCodec();
/// Trains a codec on two views of 16x24 for a few steps and puts latents beside the shards.
/// @param out  of the training. @returns the codec's weights
std::filesystem::path EncodeLearningShards(const std::filesystem::path& folder, const std::filesystem::path& out);

}  // namespace evac
