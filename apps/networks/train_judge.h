#pragma once

#include "apps/networks/judge_training.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// What a judge is made from.
struct JudgeData {
  const JudgeClipSource& learn;    ///< most of it is learned from, the rest calibrates
  const JudgeClipSource& holdout;  ///< measured on once, at the end
  std::filesystem::path init = {};  ///< a judge of the same tasks and views to go on from; empty: from nothing
};

/// Writes OUT/judge.safetensors with the weights of `data.init`, not trained on: temperature and threshold are chosen
/// anew on all of `data.learn`, each clip once, and what it is worth is measured on the hold-out. How long a clip may
/// be and at how many places it looks stay as its card has them, whatever `given` says.
/// @throws InvalidInput, TensorError naming an option that is out of range (CheckJudgeOptions); InvalidInput if
///   `data.init` is of other tasks or views, if `data.learn` has not clips of both outcomes, or for CheckSides.
void CalibrateJudge(const train::JobPlace& place, const JudgeTrainingOptions& given, const JudgeData& data);

/// Trains the classifier judge and writes OUT/judge.safetensors: its weights and its card (docs/classifier_judge.md).
/// Where the clips have a codec, `reconstructed_share` of them are shown as it gives them back, which is how a world
/// model's clips look. An interrupted training writes none.
/// @param place  of it `shards` and `config` are not read
/// @throws InvalidInput for pictures whose sides are no multiples of 8 (CheckSides), and as CalibrateJudge; TensorError
///   for the trainer's options that make no training
train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeTrainingOptions& options,
                                 const JudgeData& data);

}  // namespace evac
