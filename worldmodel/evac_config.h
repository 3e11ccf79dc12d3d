#pragma once

#include <filesystem>

#include "worldmodel/nn/model_config.h"

namespace evac {

/// Sizes of the EVAC network from a page: ours (apps/configs/evac_published.yaml lists every field; what is left out is
/// as published), or the published one (`model.params.unet_config.params.…`), whose sizes alone are read,
/// and that its network predicts velocities (`parameterization`).
/// @throws InvalidInput naming file and field: an unknown field (ours), a wrong type, a `parameterization` that is not
///   `v`, sizes that make no network, image sides that the levels do not divide.
nn::ModelConfig ReadEvacConfig(const std::filesystem::path& path);

}  // namespace evac
