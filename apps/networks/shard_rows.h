#pragma once

#include <cstdint>

#include "core/types.h"
#include "worldmodel/train/shards.h"

/// What a row of a shard says, in core's words (docs/formats/shards.md).
namespace evac {

/// One hand's eight numbers of `actions`.
ArmState ArmOf(const float* numbers);
/// A row's 16 numbers: of a robot with one arm the last eight.
Arms ArmsOfRow(const float* row, std::size_t arms);
/// One view's camera at one row, without name and mount.
Camera CameraAt(const train::Shard& shard, std::int64_t row, std::int64_t view);

}  // namespace evac
