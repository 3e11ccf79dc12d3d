#pragma once

#include <cstdint>

/// Loops over floats in memory that do in one pass what libtorch does in several: inference on the CPU only. No tensors
/// here, so that the compiler sees plain loops; each is compiled for several processors, and the best is picked when
/// the program starts. The results do not depend on the number of threads.
namespace evac::nn::kernels {

struct NormShape {
  std::int64_t samples = 0;   ///< statistics are taken over one
  std::int64_t rows = 0;      ///< of a sample
  std::int64_t channels = 0;  ///< fastest
  std::int64_t groups = 32;
  double epsilon = 1e-5;
};

/// y = (x - mean) / sqrt(variance + epsilon) * weight + bias, by groups of channels, then SiLU if asked. Two passes for
/// the statistics: a picture of one colour has a variance of rounding errors otherwise. x and y may be the same.
void GroupNorm(const NormShape& shape, const float* x, const float* weight, const float* bias, bool silu, float* y);

/// y = x[first half] * gelu(x[second half]). @param x  [rows, 2 half], @param y  [rows, half]
void GatedGelu(std::int64_t rows, std::int64_t half, const float* x, float* y);

struct TemporalShape {
  std::int64_t samples = 0, frames = 0, pixels = 0, channels = 0, heads = 0;
};

/// Attention of every pixel to itself over time. q, k, v, y: [samples, frames, pixels, channels]
void TemporalAttention(const TemporalShape& shape, const float* q, const float* k, const float* v, float* y);

/// Rows of scores to weights: exp(x - max) and the sums, kept apart so that the division is done on the smaller result.
/// @param scores  [rows, columns], replaced; @param sums  [rows]
void SoftmaxRows(std::int64_t rows, std::int64_t columns, float* scores, float* sums);

}  // namespace evac::nn::kernels
