#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "worldmodel/train/shards.h"

namespace evac {

/// A clip of a shard with what the packing knows of its recording beside the tensors; or one of a run.
struct PackedClip : train::Clip {
  std::int64_t recording = 0;  ///< of its packing
  std::string episode;         ///< of a run's clip instead: the run's folder, /, the episode's id
  std::string state;           ///< recordings that began alike share it: what data is split by
  std::string behaviour;       ///< entry of the collection's mix; empty where nobody collected it
  std::string fate;            ///< judges/attempt.h; empty where unknown
  bool is_again = false;       ///< its folder was named before: drawn from once more, measured with no second time
};

/// One split of some packings, the clips in the order of the shards.
struct PackedSet {
  /// @throws TensorError as ShardSet, and if a shard has not one clip_id per clip; InvalidInput if shards.json lacks what is said of recordings.
  PackedSet(const train::ShardFolders& folders, train::Split split);

  train::ShardSet shards;
  std::vector<PackedClip> clips;
  std::vector<std::string> tasks, cameras;
};

/// What one packing holds out, another may not learn from: each split is its packing's own.
/// @throws InvalidInput naming two of the folders and how many initial states both have; if a shards.json lacks what is
///   said of recordings, where there are several folders
void CheckHoldouts(const train::ShardFolders& folders);

/// The networks of judges and policies see a picture at an eighth of its size, and nobody opens one that learned from
/// others. @throws InvalidInput unless both sides are multiples of 8, at most 4096
void CheckSides(std::int64_t height_px, std::int64_t width_px);

}  // namespace evac
