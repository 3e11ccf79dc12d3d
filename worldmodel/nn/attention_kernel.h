#pragma once

#include <cstdint>

namespace evac::nn::kernels {

/// Rows of `width` floats that lie `stride` apart: one head of a tensor of tokens.
struct TokenRows {
  const float* at = nullptr;
  std::int64_t stride = 0;  ///< from token to token
};

struct AttentionShape {
  std::int64_t samples = 0, queries = 0, keys = 0, heads = 0, width = 0;  ///< width of a head
};

/// softmax(q kᵀ / √width) v per sample and head, a few queries at a time: the scores of all queries are never in memory
/// together (after Dao et al. 2022). Plain floats on the CPU; the result does not depend on the number of threads.
/// @param q, k, v  `at` is the first sample's first token; samples lie `queries` (of q) or `keys` (of k and v) strides
/// apart
/// @param y        [samples, queries, heads, width]
void TiledAttention(const AttentionShape& shape, const TokenRows& q, const TokenRows& k, const TokenRows& v, float* y);

}  // namespace evac::nn::kernels
