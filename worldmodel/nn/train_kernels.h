#pragma once

#include <cstdint>

#include "worldmodel/nn/kernels.h"

/// Loops over memory for training on the CPU: layers and their gradients in few passes. Values are floats or bf16 (read
/// and written so, computed as floats); statistics, weights and their gradients are floats. The results do not depend
/// on the number of threads. The operators of libtorch are their second opinion in the tests.
namespace evac::nn::kernels {

/// Numbers in memory, floats or bf16.
struct Values {
  void* at = nullptr;
  bool bf16 = false;
};

/// What a norm keeps for its gradient: [samples, groups] each.
struct NormStatistics {
  float *mean, *inverse_deviation;
};

struct NormGradients {
  Values x;
  float *weight, *bias;  ///< [channels], replaced
};

void GroupNormForward(const NormShape& shape, const Values& x, const float* weight_bias[2], bool silu,
                      const NormStatistics& statistics, const Values& y);
void GroupNormBackward(const NormShape& shape, const Values& x, const float* weight_bias[2], bool silu,
                       const NormStatistics& statistics, const Values& gradient, const NormGradients& gradients);

/// Over the last axis: `shape.samples` is 1, `shape.rows` counts, `shape.groups` is 1. Statistics [rows].
void LayerNormForward(const NormShape& shape, const Values& x, const float* weight_bias[2],
                      const NormStatistics& statistics, const Values& y);
void LayerNormBackward(const NormShape& shape, const Values& x, const float* weight, const NormStatistics& statistics,
                       const Values& gradient, const NormGradients& gradients);

/// y = x[first half] * gelu(x[second half]). @param x  [rows, 2 half], @param y  [rows, half]
void GatedGeluForward(std::int64_t rows, std::int64_t half, const Values& x, const Values& y);
void GatedGeluBackward(std::int64_t rows, std::int64_t half, const Values& x, const Values& gradient,
                       const Values& x_gradient);

/// Many small attentions: for each of `outer` times `inner` and each head, `queries` tokens hear `keys` tokens.
struct SmallAttentionShape {
  std::int64_t outer = 0, inner = 1, queries = 0, keys = 0, heads = 0, width = 0;
  /// Tokens of one attention lie `inner` rows of heads x width numbers apart.
  std::int64_t Row() const { return heads * width; }
};

struct AttentionTensors {
  Values q, k, v, y;  ///< [outer, queries or keys, inner, heads, width]
  float* weights;     ///< [outer, inner, heads, queries, keys]: after softmax, kept for the gradient
};
void SmallAttentionForward(const SmallAttentionShape& shape, const AttentionTensors& tensors);

struct AttentionGradients {
  Values y;        ///< given
  Values q, k, v;  ///< replaced
};
void SmallAttentionBackward(const SmallAttentionShape& shape, const AttentionTensors& tensors,
                            const AttentionGradients& gradients);

}  // namespace evac::nn::kernels
