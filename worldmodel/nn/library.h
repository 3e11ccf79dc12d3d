#pragma once

#include <string>

/// The libtorch that this program runs with.
namespace evac::nn {

/// "1.13.0".
std::string LibtorchVersion();
/// What numbers are computed by here, its rounding with it: libtorch, the kernels that OpenBLAS picked (where libtorch
/// multiplies with it), those of ours that were picked, what the processor multiplies bf16 by.
/// "libtorch 1.13.0 blas SkylakeX kernels x86-64-v4 bf16 avx512bf16 amx-bf16".
std::string Arithmetic();
/// Whether it can use a GPU here.
bool HasCuda();

}  // namespace evac::nn
