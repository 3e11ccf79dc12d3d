#pragma once

#include <vector>

#include "worldmodel/nn/sampler.h"

/// DPM-Solver++(2M) (Lu et al. 2022): the same noise to nearly the same picture in a third of DDIM's steps.
namespace evac::nn {

/// The steps at which the network is asked, descending from the schedule's last to 0, evenly spaced in the angle
/// between signal and noise, so that neither end is skipped over.
/// @throws TensorError unless 2 <= calls <= the schedule's steps.
std::vector<std::int64_t> DpmSolverSteps(const NoiseSchedule& schedule, std::int64_t calls);

/// Deterministic: follows the probability flow from noise to step 0 in `calls` - 1 steps of second order; the last call
/// turns what it finds there into clean latents.
/// @returns [BV, z, T, h, w], memory frames as given
Tensor SampleDpmSolver(const NoiseSchedule& schedule, std::int64_t calls, const SampleStart& start,
                       const Denoise& denoise, const StepObserver* observer = nullptr);

}  // namespace evac::nn
