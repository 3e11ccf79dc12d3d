#pragma once

#include <string>

#include "worldmodel/imaginer.h"

namespace evac {

/// SHA-256 of everything that decides what is imagined of a chunk: the network and its options, the remembered latents,
/// the first picture, what the chunk's maps, rays and deltas say, the noise. 64 hex digits.
std::string ChunkKey(const ImaginerOptions& options, const ImaginedScene& scene, const ChunkConditioning& conditioning);

}  // namespace evac
