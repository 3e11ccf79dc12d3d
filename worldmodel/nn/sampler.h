#pragma once

#include <functional>

#include "worldmodel/nn/noise_schedule.h"

/// What the samplers share. They know no network: `Denoise` may as well be an analytic Gaussian.
namespace evac::nn {

/// v at diffusion step t of every frame of x_t [BV, z, T, h, w].
using Denoise = std::function<Tensor(const Tensor& x_t, std::int64_t t)>;

/// Standard normal numbers in the shape of x_t, new ones at each call.
using DrawNoise = std::function<Tensor()>;

/// Called after each step with the step's index, x before memory is put back, and the clean latents it aims at.
using StepObserver = std::function<void(std::int64_t index, const Tensor& x_previous, const Tensor& x0)>;

/// Where sampling starts.
struct SampleStart {
  Tensor x;                  ///< [BV, z, T, h, w]: `memory` clean latents, then standard normal noise
  std::int64_t memory = 0;   ///< N: frames that stay what they are
  bool scale_memory = true;  ///< as in training; the reference forgets it (quirk memory_not_scaled)
};

/// Classifier-free guidance: u + scale (c - u), then pulled towards c's spread by `rescale` (Lin et al. 2024,
/// Sec. 3.4).
Denoise Guided(Denoise conditional, Denoise unconditional, double scale, double rescale);

/// x with its memory frames as the network is to see them at step t.
Tensor WithMemory(const Tensor& x, const SampleStart& start, const NoiseSchedule& schedule, std::int64_t t);
/// x with its memory frames as they were given.
Tensor WithCleanMemory(const Tensor& x, const SampleStart& start);

}  // namespace evac::nn
