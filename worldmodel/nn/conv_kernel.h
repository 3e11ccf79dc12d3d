#pragma once

#include <cstdint>

/// Convolutions of 3x3, one place of zeros around, by F(4x4, 3x3) of Lavin and Gray (arXiv 1509.09308): 36 products a
/// square of 4x4 and pair of channels instead of 144. Floats in memory, on the CPU. Sums are some three to five times
/// as far off as those of a convolution done place by place. The results do not depend on the number of threads.
namespace evac::nn::kernels {

struct ConvShape {
  std::int64_t samples = 0, height = 0, width = 0;
  std::int64_t in = 0, out = 0;  ///< channels, fastest
};

/// @param x       [samples, height, width, in]
/// @param weight  [out, in, 3, 3]
/// @param bias    [out]; null: none
/// @param y       [samples, height, width, out]
void Conv3x3(const ConvShape& shape, const float* x, const float* weight, const float* bias, float* y);

/// The gradient of its weights.
/// @param gradient         [samples, height, width, out], of y
/// @param weight_gradient  [out, in, 3, 3]
void Conv3x3WeightGradient(const ConvShape& shape, const float* x, const float* gradient, float* weight_gradient);

}  // namespace evac::nn::kernels
