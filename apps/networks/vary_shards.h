#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace evac {

struct VaryArguments {
  std::filesystem::path shards, collection, recipe;
  std::vector<std::string> assignments;  ///< `--set`, as the collection was made with
  int count = 4;  ///< variants of each clip
  std::uint64_t seed = 1;
  int jobs = 0;  ///< clips at the same time; 0: one per core. Changes no byte
};

/// Does what each clip's arms were told again and again in its scene, each time a little differently (variation.h), and
/// writes what came of it beside the shard: variants_00000.safetensors (docs/formats/shards.md). Nothing is drawn.
/// Files that are there, made of the same, are not made again; others are replaced one by one, and until that came to
/// its end nothing learns from the folder's variants. SHARDS/variants_begun_by says which evac began; where another
/// goes on, a note on stderr does.
/// @throws InvalidInput if the shards are not of this collection, or the collection not of this recipe, or another
/// process writes the folder
void VaryShards(const VaryArguments& arguments);

}  // namespace evac
