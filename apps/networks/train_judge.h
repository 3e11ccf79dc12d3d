#pragma once

#include "apps/networks/judge_training.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// What a judge is made from.
struct JudgeData {
  const JudgeClipSource& learn;    ///< most of it is learned from, the rest calibrates
  const JudgeClipSource& holdout;  ///< measured on once, at the end
};

/// Trains the classifier judge and writes OUT/judge.safetensors: its weights and its card (docs/classifier_judge.md).
/// Where the clips have a codec, `reconstructed_share` of them are shown as it gives them back, which is how a world
/// model's clips look. An interrupted training writes none.
/// @param place  of it `shards` and `config` are not read
train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeTrainingOptions& options,
                                 const JudgeData& data);

}  // namespace evac
