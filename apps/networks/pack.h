#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/networks/pack_sources.h"

namespace evac {

inline constexpr double kShardMb = 2000;

struct PackArguments {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path out, config;
  std::filesystem::path statistics;  ///< of the actions, as weights were trained with; empty: of these recordings
  std::vector<std::string> cameras;
  ArmsKind arms = ArmsKind::kAuto;
  double period_s = 0.1;
  int crops = 1;            ///< clips per recording: the whole picture, then random crops
  double hold_out = 0.05;   ///< share of initial states whose recordings are kept for testing
  int clips_per_shard = 64;  ///< at most
  double shard_mb = kShardMb;  ///< of pictures and maps, at most: a shard lies in memory while it is made. One clip may have more
  std::uint64_t seed = 1;   ///< of crops, split and order
  int jobs = 0;             ///< shards made at the same time; 0: one per core. Changes no byte
};

/// Turns recordings into the shards that `out` does not have yet (docs/formats/shards.md); says on stderr how far it is
/// and what was left out.
/// @throws InvalidInput if `cameras` are not as many as the page's views, no recording can be packed, a task's name has
///   a comma, or `out` holds another packing.
void Pack(const PackArguments& arguments);

}  // namespace evac
