#pragma once

#include "worldmodel/nn/tensor.h"

/// The layers that libtorch is slow to differentiate on the CPU, by the loops of train_kernels.h: one pass where its
/// operators take several, and bf16 values without a detour through copies. Each has those operators as its second
/// opinion in the tests.
namespace evac::nn {

/// Whether x may go through them: floats or bf16 on the CPU.
bool HasFastGradient(const Tensor& x);

struct NormOptions {
  std::int64_t groups = 32;
  double epsilon = 1e-5;
  bool silu = false;
};
/// @param x  [N, ..., C]; statistics over everything but the first axis, by groups of channels
/// @param weight, bias  [C] floats
Tensor FastGroupNorm(const Tensor& x, const Tensor& weight, const Tensor& bias, const NormOptions& options);
/// Over the last axis.
Tensor FastLayerNorm(const Tensor& x, const Tensor& weight, const Tensor& bias, double epsilon);
/// [..., 2 half] → [..., half]: the first half times GELU of the second.
Tensor FastGatedGelu(const Tensor& x);
/// softmax(q kᵀ / √d) v for every head of attentions that lie `inner` beside each other, d = C / heads.
/// @param q     [outer, queries, inner, C]
/// @param k, v  [outer, keys, inner, C]
Tensor FastAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads);
/// A convolution of 3x3, one place of zeros around: floats alone (conv_kernel.h).
/// @param x       [N, H, W, in]
/// @param weight  [out, in, 3, 3]
/// @param bias    [out]
/// @returns       [N, H, W, out]
Tensor FastConv3x3(const Tensor& x, const Tensor& weight, const Tensor& bias);
/// [N, T, L, C] → [N, T + 2, L, C]: the first frame three times.
Tensor FastCausalPad(const Tensor& x);

}  // namespace evac::nn
