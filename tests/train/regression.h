#pragma once

#include <vector>

#include "worldmodel/train/trainer.h"

namespace evac::train {

/// A network of two parameters, and noisy data that it can learn.
struct Regression {
  Tensor weight = at::zeros({3, 1}), bias = at::zeros({1});
  std::vector<NamedTensor> Parameters() const { return {{"weight", weight}, {"bias", bias}}; }
  Tensor Loss(const StepPlace& place) const {
    Dice dice(place, 1);
    const Tensor x = dice.Normal({16, 3}), noise = dice.Normal({16, 1}) * 0.1;
    const Tensor y = at::matmul(x, at::tensor({1.0F, -2.0F, 0.5F}).reshape({3, 1})) + 3 + noise;
    return (at::matmul(x, weight) + bias - y).square().mean();
  }
  Tensor All() const { return at::cat({weight.detach().flatten(), bias.detach()}).clone(); }
};

inline TrainerOptions QuickTrainer(std::int64_t steps) {
  TrainerOptions options;
  options.steps = steps;
  options.learning_rate = 0.05;
  options.adamw.weight_decay = 0;
  options.average_decay = 0.9;
  options.clip_norm = 10;
  options.decay_from = 0.5;
  options.seed = 5;
  return options;
}

}  // namespace evac::train
