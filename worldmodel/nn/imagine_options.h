#pragma once

#include <cstdint>
#include <functional>

namespace evac::nn {

enum class Solver { kDdim, kDpmSolver };

/// How a chunk is denoised. No tensors here: suites and command lines fill it in.
struct ImagineOptions {
  Solver solver = Solver::kDdim;
  std::int64_t steps = 27;  ///< times the network is asked
  double eta = 1;           ///< of DDIM: 0 deterministic … 1
  double guidance = 1;      ///< 1: the unconditional half is not computed
  double guidance_rescale = 0.7;
  bool memory_not_scaled = false;  ///< quirk of the reference: see docs/evac_quirks.md
  bool residual_noise = false;     ///< likewise
  /// Called after each step by the thread that denoises; what it throws ends the chunk. No part of any result.
  std::function<void()> on_step;
};

}  // namespace evac::nn
