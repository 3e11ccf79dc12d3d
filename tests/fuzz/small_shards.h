#pragma once

#include <filesystem>
#include <string>

/// A packing that is right and small, without libtorch: shard_00000 for training, shard_00001 for hold-out, each of two
/// clips of two frames, one view of 8 x 8 pixels, with latents of 2 channels and stride 4, and two variants; and
/// shards.json (docs/formats/shards.md). Nothing compares a shard's bytes with the SHA-256 that it says: any text does.
/// @param split  of the first shard
void WriteSmallShards(const std::filesystem::path& folder, const std::string& split = "train");

/// Of its latents.
constexpr int kSmallLatentChannels = 2, kSmallLatentStride = 4;
constexpr double kSmallScaleFactor = 0.5;
