#pragma once

#include <filesystem>
#include <string>

namespace evac {

/// Which codec a file holds, alone or in a checkpoint: SHA-256 of its tensors' names, shapes and numbers as floats, in
/// the order of their names. What else is in the file, and in which type, does not count: a world model that was
/// trained on keeps its codec's latents. docs/formats/shards.md
/// @throws TensorError if the file holds none, or is broken.
std::string CodecSha256(const std::filesystem::path& weights);

}  // namespace evac
