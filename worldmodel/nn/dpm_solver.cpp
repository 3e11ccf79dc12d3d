#include "worldmodel/nn/dpm_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace evac::nn {
namespace {

/// x_t = signal x0 + noise ε. The rescaling of clean latents is part of the signal.
struct Level {
  double signal = 0, noise = 1;
  double Ratio() const { return signal / noise; }  ///< rises from 0
};

Level LevelAt(const NoiseSchedule& schedule, std::int64_t t) {
  return {std::sqrt(schedule.AlphaBar(t)) * schedule.Scale(t), std::sqrt(1 - schedule.AlphaBar(t))};
}

struct Estimate {
  Tensor x0;
  double ratio = 0;
};

/// How far the straight line through the last two estimates is to be followed: the factor on (x0 - the one before).
double Extrapolation(double before, double now, double next) {
  if (before > 0) return 0.5 * std::log(next / now) / std::log(now / before);  // in log SNR (Lu et al., Alg. 2)
  return 0.5 * (next - now) / now;  // from pure noise, where that is infinite
}

}  // namespace

std::vector<std::int64_t> DpmSolverSteps(const NoiseSchedule& schedule, std::int64_t calls) {
  if (calls < 2 || calls > schedule.steps())
    throw TensorError(std::to_string(calls) + " sampler steps, wanted 2 to " + std::to_string(schedule.steps()));
  const auto angle = [&](std::int64_t t) {
    const Level level = LevelAt(schedule, t);
    return std::atan2(level.noise, level.signal);
  };
  const std::int64_t last = schedule.steps() - 1;
  const double from = angle(last), to = angle(0);
  std::vector<std::int64_t> steps = {last};
  for (std::int64_t i = 1; i < calls; ++i) {
    const double wanted = from + (to - from) * static_cast<double>(i) / static_cast<double>(calls - 1);
    std::int64_t t = steps.back() - 1;
    while (t > calls - 1 - i && std::abs(angle(t - 1) - wanted) <= std::abs(angle(t) - wanted)) --t;
    steps.push_back(t);
  }
  steps.back() = 0;
  return steps;
}

Tensor SampleDpmSolver(const NoiseSchedule& schedule, std::int64_t calls, const SampleStart& start,
                       const Denoise& denoise, const StepObserver* observer) {
  const std::vector<std::int64_t> steps = DpmSolverSteps(schedule, calls);
  Tensor x = start.x;
  std::optional<Estimate> before;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const std::int64_t t = steps[i];
    const Level level = LevelAt(schedule, t);
    const Tensor x_t = WithMemory(x, start, schedule, t);
    const Tensor x0 = CleanFrom(x_t, denoise(x_t, t), schedule.AlphaBar(t)) / schedule.Scale(t);
    if (observer != nullptr) (*observer)(static_cast<std::int64_t>(steps.size() - 1 - i), x_t, x0);
    if (i + 1 == steps.size()) return WithCleanMemory(x0, start);
    const Level next = LevelAt(schedule, steps[i + 1]);
    Tensor aim = x0;
    if (before) aim = x0 + (x0 - before->x0) * Extrapolation(before->ratio, level.Ratio(), next.Ratio());
    // d(x / noise) = x0 d(signal / noise), exactly.
    x = (x_t / level.noise + aim * (next.Ratio() - level.Ratio())) * next.noise;
    before = {x0, level.Ratio()};
  }
  return WithCleanMemory(x, start);
}

}  // namespace evac::nn
