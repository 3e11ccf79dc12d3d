#pragma once

#include "apps/judge_training.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// Trains the classifier judge and writes OUT/judge.safetensors: its weights and its card (docs/classifier_judge.md).
/// It learns from most initial states of the training split, is calibrated on the rest of them, and measured on the
/// hold-out split, which nothing else sees. An interrupted training writes none.
train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeOptions& options);

}  // namespace evac
