#pragma once

#include <cstdint>

#include "worldmodel/nn/tensor.h"

namespace evac::train {

using at::Tensor;

struct AdamWOptions {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;
  double weight_decay = 0.01;  ///< of all parameters, apart from the gradient (Loshchilov and Hutter 2019)
};

/// What the optimiser remembers. Each [count] floats.
struct AdamWState {
  Tensor values;          ///< what is trained
  Tensor gradients;       ///< of this step
  Tensor first_moment;    ///< running mean of the gradients
  Tensor second_moment;   ///< of their squares
  Tensor average;         ///< exponential moving average of the values; undefined: none is kept
};

struct AdamWStep {
  std::int64_t step = 0;        ///< from 0
  double learning_rate = 1e-3;
  double gradient_factor = 1;   ///< clipping: gradients are taken times this
  double average_decay = 0;     ///< the average keeps this much of itself
};

/// One step of AdamW with bias correction, and of the average; sets the gradients to 0. On the CPU in one pass, the
/// same numbers for any number of threads.
void StepAdamW(const AdamWState& state, const AdamWOptions& options, const AdamWStep& step);

/// √ of the sum of squares, the same for any number of threads. @param flat  [count] floats
double Norm(const Tensor& flat);

}  // namespace evac::train
