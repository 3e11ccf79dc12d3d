#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "worldmodel/nn/vae.h"
#include "worldmodel/train/shards.h"

namespace evac::train {

/// Clips of a bright square that goes where the actions say, on a ground that differs from clip to clip: small enough
/// to learn in a test. The object is the square; it is "in contact" in the middle of each clip.
struct SyntheticShards {
  std::int64_t clips = 6;        ///< of each split
  std::int64_t frames = 9;       ///< of a clip
  std::int64_t failures = 0;     ///< of the clips of each split; the others are successes
  std::int64_t closes_at = 0;    ///< above 0: the second clip's hand is told to close at this frame, no other is
  std::int64_t opens_at = 0;     ///< above 0: and to open again at this one
  bool knows_object = true;      ///< whether they say where the square is
  std::int64_t views = 1;
  double step_px = 3;        ///< how far the square goes at most from frame to frame, along each side
  double wrist_swing_m = 0;  ///< how far along x the second view's camera is in every other frame
  std::int64_t height_px = 16, width_px = 24;
  std::uint64_t seed = 1;
  const char* statistics = "synthetic";
  const char* tasks = "follow";  ///< with commas between them
  int task = 0;                  ///< of these, that of all clips
  const char* arms_read = "";    ///< told or measured; empty: they do not say it, as those of earlier versions
};

/// Writes shard_00000 (train), shard_00001 (hold-out) and shards.json, as docs/formats/shards.md says.
void WriteSyntheticShards(const std::filesystem::path& folder, const SyntheticShards& options);

/// Writes the training shard anew.
/// @param change    is given each tensor's name and a copy of it, to change or to replace
/// @param metadata  keys that are said otherwise
void ChangeSyntheticShard(const std::filesystem::path& folder,
                          const std::function<void(const std::string& name, Tensor& tensor)>& change,
                          const TensorMetadata& metadata = {});

/// The latents of every shard of a folder, as `evac encode` makes them, of a codec named "codec".
void EncodeSyntheticShards(const nn::Vae& vae, const std::filesystem::path& folder,
                           const std::string& products = "float32");

}  // namespace evac::train
