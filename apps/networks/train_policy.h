#pragma once

#include "apps/networks/policy_training.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// Trains a policy by imitation and writes OUT/policy.safetensors: its weights and its card (docs/learned_policy.md).
/// @param codec  that encoded the shards, or null: then pictures are shown as they were seen alone. Outlives the call
/// @param keep_steps  after each of these the averaged weights are kept as OUT/policy_<step>.safetensors: checkpoints of one training
/// @throws InvalidInput for one of these that an earlier call has done without keeping it, and for pictures whose sides
///   are no multiples of 8 (CheckSides), and as PolicyTraining, of either split; TensorError for options that make no
///   training
train::TrainerSummary TrainPolicy(const train::JobPlace& place, const PolicyOptions& options, const ShardCodec* codec,
                                  const std::vector<std::int64_t>& keep_steps);

}  // namespace evac
