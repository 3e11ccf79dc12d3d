#pragma once

#include <filesystem>
#include <string>

namespace evac {

/// Which codec a file holds, alone or in a checkpoint: SHA-256 of its tensors' names, types, shapes and bytes, in the
/// order of their names. What else is in the file does not count, so a world model that was trained on keeps its
/// codec's latents; the same numbers in another type are another codec. docs/formats/shards.md
/// @throws TensorError if the file holds none, or is broken.
std::string CodecSha256(const std::filesystem::path& weights);

}  // namespace evac
