#include "worldmodel/nn/ddim.h"

#include <algorithm>
#include <cmath>

namespace evac::nn {
namespace {

std::vector<std::int64_t> TrailingSteps(std::int64_t all, std::int64_t wanted) {
  std::vector<std::int64_t> steps;
  const double stride = static_cast<double>(all) / static_cast<double>(wanted);
  for (std::int64_t i = wanted; i-- > 0;) {
    const double at = static_cast<double>(all) - static_cast<double>(i) * stride;
    steps.push_back(static_cast<std::int64_t>(std::nearbyint(at)) - 1);  // half to even
  }
  return steps;
}

struct Moved {
  Tensor x, x0;
};

Moved Take(const DdimStep& step, const Tensor& x_t, const Tensor& v, const DrawNoise& noise) {
  const Tensor eps = NoiseFrom(x_t, v, step.alpha_bar);
  const Tensor x0 = CleanFrom(x_t, v, step.alpha_bar) * (step.scale_previous / step.scale);
  // In float, as the reference has it: from pure noise nothing is left at eta 1, and the root of the rounding is no
  // longer small.
  const auto sigma = static_cast<float>(step.sigma);
  const float left = std::max(0.0F, 1.0F - static_cast<float>(step.alpha_bar_previous) - sigma * sigma);
  Tensor x = x0 * std::sqrt(step.alpha_bar_previous) + eps * static_cast<double>(std::sqrt(left));
  if (step.sigma > 0) x = x + noise() * step.sigma;
  return {x, x0};
}

}  // namespace

std::vector<DdimStep> DdimTable(const NoiseSchedule& schedule, const DdimOptions& options) {
  if (options.steps < 1 || options.steps > schedule.steps())
    throw TensorError(std::to_string(options.steps) + " sampler steps, wanted 1 to " +
                      std::to_string(schedule.steps()));
  if (!(options.eta >= 0 && options.eta <= 1))
    throw TensorError("eta is " + std::to_string(options.eta) + ", wanted 0 to 1");
  std::vector<DdimStep> table;
  for (const std::int64_t t : TrailingSteps(schedule.steps(), options.steps)) {
    DdimStep step{t, schedule.AlphaBar(t), 1, 0, schedule.Scale(t), 1};
    if (!table.empty()) {
      step.alpha_bar_previous = table.back().alpha_bar;
      step.scale_previous = table.back().scale;
    } else if (options.end_at_first_step) {
      step.alpha_bar_previous = schedule.AlphaBar(0);
      step.scale_previous = step.scale;
    }
    step.sigma = options.eta * std::sqrt((1 - step.alpha_bar_previous) / (1 - step.alpha_bar) *
                                         (1 - step.alpha_bar / step.alpha_bar_previous));
    table.push_back(step);
  }
  return table;
}

Tensor SampleDdim(const NoiseSchedule& schedule, const DdimOptions& options, const SampleStart& start,
                  const Denoise& denoise, const DrawNoise& noise, const StepObserver* observer) {
  const std::vector<DdimStep> table = DdimTable(schedule, options);
  Tensor x = start.x;
  for (std::size_t index = table.size(); index-- > 0;) {
    const DdimStep& step = table[index];
    const Tensor x_t = WithMemory(x, start, schedule, step.t);
    const Moved moved = Take(step, x_t, denoise(x_t, step.t), noise);
    if (observer != nullptr) (*observer)(static_cast<std::int64_t>(index), moved.x, moved.x0);
    x = moved.x;
  }
  return WithCleanMemory(x, start);
}

}  // namespace evac::nn
