#pragma once

#include <string>

#include "worldmodel/imaginer.h"

namespace evac {

/// The part of the key that is the same for all chunks: the program, the libraries and kernels that compute on this
/// processor, the network (`identity`), the sampler. The deltas and maps say what statistics, stride and sizes of discs
/// do, so those are not listed.
std::string ChunkSettings(const ImaginerOptions& options);

/// SHA-256 of everything that decides what is imagined of a chunk: ChunkSettings, the remembered latents, the first and
/// the newest picture, what the chunk's arms, maps, rays and deltas say, the noise. 64 hex digits.
std::string ChunkKey(const ImaginerOptions& options, const ImaginedScene& scene, const ChunkConditioning& conditioning);

}  // namespace evac
