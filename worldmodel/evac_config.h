#pragma once

#include <filesystem>

#include "worldmodel/nn/model_config.h"

namespace evac {

/// Sizes of the EVAC network from a page: ours (apps/configs/evac_published.yaml lists every field; what is left out is
/// as published), or the published one (`model.params.unet_config.params.…`), whose sizes alone are read.
/// @throws InvalidInput naming file and field: an unknown field (ours), a wrong type, sizes that make no network, image
/// sides that the
///   levels do not divide.
nn::ModelConfig ReadEvacConfig(const std::filesystem::path& path);

}  // namespace evac
