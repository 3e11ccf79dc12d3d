#include "worldmodel/train/adamw.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "worldmodel/nn/processors.h"

namespace evac::train {
namespace {

constexpr std::int64_t kBlock = 1 << 14;

/// The numbers of one step that are the same for every parameter.
struct Factors {
  float keep, rate, beta1, beta2, epsilon, root_correction2, gradient_factor, average_decay;
};

Factors FactorsOf(const AdamWOptions& options, const AdamWStep& step) {
  const auto steps = static_cast<double>(step.step + 1);
  const double correction1 = 1 - std::pow(options.beta1, steps), correction2 = 1 - std::pow(options.beta2, steps);
  return {static_cast<float>(1 - step.learning_rate * options.weight_decay),
          static_cast<float>(step.learning_rate / correction1),
          static_cast<float>(options.beta1),
          static_cast<float>(options.beta2),
          static_cast<float>(options.epsilon),
          static_cast<float>(1 / std::sqrt(correction2)),
          static_cast<float>(step.gradient_factor),
          static_cast<float>(step.average_decay)};
}

struct Block {
  std::int64_t count;
  float *values, *gradients, *first, *second, *average;
};

EVAC_EACH_PROCESSOR void StepBlock(const Block& block, const Factors& f) {
  float *values = block.values, *gradients = block.gradients, *first = block.first, *second = block.second;
#pragma omp simd
  for (std::int64_t i = 0; i < block.count; ++i) {
    const float gradient = gradients[i] * f.gradient_factor;
    gradients[i] = 0;
    first[i] = f.beta1 * first[i] + (1 - f.beta1) * gradient;
    second[i] = f.beta2 * second[i] + (1 - f.beta2) * gradient * gradient;
    values[i] = f.keep * values[i] - f.rate * first[i] / (std::sqrt(second[i]) * f.root_correction2 + f.epsilon);
  }
  if (block.average == nullptr) return;
#pragma omp simd
  for (std::int64_t i = 0; i < block.count; ++i)
    block.average[i] += (1 - f.average_decay) * (values[i] - block.average[i]);
}

EVAC_EACH_PROCESSOR double SumOfSquares(std::int64_t count, const float* values) {
  double sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::int64_t i = 0; i < count; ++i) sum += static_cast<double>(values[i]) * static_cast<double>(values[i]);
  return sum;
}

void StepOnCpu(const AdamWState& state, const Factors& factors) {
  const std::int64_t count = state.values.numel();
  float* average = state.average.defined() ? state.average.data_ptr<float>() : nullptr;
  float *values = state.values.data_ptr<float>(), *gradients = state.gradients.data_ptr<float>();
  float *first = state.first_moment.data_ptr<float>(), *second = state.second_moment.data_ptr<float>();
#pragma omp parallel for schedule(static)
  for (std::int64_t from = 0; from < count; from += kBlock) {
    StepBlock({std::min(kBlock, count - from), values + from, gradients + from, first + from, second + from,
               average ? average + from : nullptr},
              factors);
  }
}

void StepAnywhere(const AdamWState& state, const Factors& f) {
  const Tensor gradient = state.gradients * f.gradient_factor;
  Tensor values = state.values, first = state.first_moment, second = state.second_moment;
  first.mul_(f.beta1).add_(gradient, 1 - f.beta1);
  second.mul_(f.beta2).add_(gradient * gradient, 1 - f.beta2);
  values.mul_(f.keep).sub_(first / (second.sqrt() * f.root_correction2 + f.epsilon) * f.rate);
  if (state.average.defined()) Tensor(state.average).add_(values - state.average, 1 - f.average_decay);
  Tensor(state.gradients).zero_();
}

}  // namespace

void StepAdamW(const AdamWState& state, const AdamWOptions& options, const AdamWStep& step) {
  const at::NoGradGuard no_gradients;
  const Factors factors = FactorsOf(options, step);
  state.values.is_cpu() ? StepOnCpu(state, factors) : StepAnywhere(state, factors);
}

double Norm(const Tensor& flat) {
  if (!flat.is_cpu()) return flat.norm().item<double>();
  const std::int64_t count = flat.numel();
  const float* values = flat.data_ptr<float>();
  std::vector<double> partial(static_cast<std::size_t>((count + kBlock - 1) / kBlock));
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < static_cast<std::int64_t>(partial.size()); ++i)
    partial[static_cast<std::size_t>(i)] = SumOfSquares(std::min(kBlock, count - i * kBlock), values + i * kBlock);
  double sum = 0;
  for (const double part : partial) sum += part;
  return std::sqrt(sum);
}

}  // namespace evac::train
