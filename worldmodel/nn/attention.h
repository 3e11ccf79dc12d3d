#pragma once

#include "worldmodel/nn/layers.h"

namespace evac::nn {

/// softmax(q kᵀ / √d) v for every head, d = C / heads. The plain way: all scores stand in memory at once.
/// @param q  [N, L, C]
/// @param k  [N, M, C]
/// @param v  [N, M, C]
/// @returns  [N, L, C]
Tensor PlainAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads);

/// The same numbers, to rounding; picks the fastest way there is for these sizes.
Tensor Attention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads);

/// Attention of every pixel to itself over time.
/// @param q  [N, T, L, C]; k and v alike
/// @returns  [N, T, L, C]
Tensor TemporalAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads);

}  // namespace evac::nn
