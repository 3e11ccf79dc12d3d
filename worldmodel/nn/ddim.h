#pragma once

#include <vector>

#include "worldmodel/nn/sampler.h"

/// DDIM (Song et al. 2021) as the reference samples (docs/evac_quirks.md): trailing steps, stochastic by default.
namespace evac::nn {

struct DdimOptions {
  std::int64_t steps = 27;
  double eta = 1;  ///< 0: deterministic
  /// Quirk residual_noise: the reference's last step stops at step 0's noise and at the scale of the step before it, so
  /// that what it answers is .97 of a clean latent with .03 of noise; without it the last step ends clean.
  bool end_at_first_step = false;
};

/// One step of the table, by index: 0 is the last to be taken.
struct DdimStep {
  std::int64_t t = 0;
  double alpha_bar = 0, alpha_bar_previous = 1;
  double sigma = 0;
  double scale = 1, scale_previous = 1;
};

/// Steps round(T - i T / S) - 1, ascending.
/// @throws TensorError unless 1 <= steps <= the schedule's, and eta in [0, 1].
std::vector<DdimStep> DdimTable(const NoiseSchedule& schedule, const DdimOptions& options);

/// @param noise  if eta > 0 called once per step that ends in noise: not for the last, unless `end_at_first_step`
/// @returns [BV, z, T, h, w], memory frames as given
Tensor SampleDdim(const NoiseSchedule& schedule, const DdimOptions& options, const SampleStart& start,
                  const Denoise& denoise, const DrawNoise& noise, const StepObserver* observer = nullptr);

}  // namespace evac::nn
