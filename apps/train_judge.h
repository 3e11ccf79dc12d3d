#pragma once

#include "apps/judge_training.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// Trains the classifier judge and writes OUT/judge.safetensors: its weights and its card (docs/classifier_judge.md).
/// It learns from most initial states of the training split, is calibrated on the rest of them, and measured on the
/// hold-out split, which nothing else sees. An interrupted training writes none.
/// @param codec  whose latents the shards have: `reconstructed_share` of the clips are shown as it gives them back, which
///   is how a world model's clips look. Null: none are
train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeOptions& options,
                                 const JudgeCodec* codec = nullptr);

}  // namespace evac
