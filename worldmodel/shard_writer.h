#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/tensor_file.h"
#include "worldmodel/clip.h"

namespace evac {

/// Writes one shard (docs/formats/shards.md): the clips one after the other, whole or not at all. The same clips and
/// metadata give the same bytes.
/// @param clips      at least one, all with as many views
/// @param picture_px of every clip
/// @param metadata   all but format and version, which are added
void WriteShard(const std::filesystem::path& path, std::span<const Clip> clips, const cv::Size& picture_px,
                TensorMetadata metadata);

/// "radius_px=10 thickness_px=2": the metadata's words for how maps are drawn.
std::string PoseMapWords(const PoseMapOptions& options);

}  // namespace evac
