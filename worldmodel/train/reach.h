#pragma once

#include "worldmodel/nn/model_config.h"
#include "worldmodel/train/world_batch.h"

namespace evac::train {

/// Where the task's object may be in a chunk, as far as that is known before it: where the newest memory frame has it
/// (a camera that moves: as a point of `schedule.carry_plane_m`), and wherever the grippers are told to go. What then
/// happened has no part in it.
///
/// A loss that counts more where the object *is* counts an object that was taken and is drawn on the table for more
/// than one that was left and is drawn in the hand: a network that cannot tell draws both.
/// @param radius  of a bell, in latent pixels
/// @returns [BV, 1, K, h, w] in [0, 1]: 1 at such a place, 0 far from all
Tensor WithinReach(const WorldBatch& batch, const nn::ModelConfig& config, double radius);

}  // namespace evac::train
