#include "worldmodel/nn/attention.h"

#include <ATen/record_function.h>

#include <cmath>

#include "worldmodel/nn/attention_kernel.h"
#include "worldmodel/nn/differentiable.h"
#include "worldmodel/nn/kernels.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kSmallScores = 1 << 14;

/// [N, L, C] → [N, heads, L, C / heads]
Tensor SplitHeads(const Tensor& x, std::int64_t heads) {
  return x.reshape({x.size(0), x.size(1), heads, x.size(2) / heads}).transpose(1, 2);
}

/// Floats on the CPU, not to be differentiated, tokens evenly spaced: also a part of a wider tensor.
bool CanBeTiled(const Tensor& x) {
  return !at::GradMode::is_enabled() && x.is_cpu() && x.scalar_type() == at::kFloat && x.stride(2) == 1 &&
         (x.size(0) == 1 || x.stride(0) == x.size(1) * x.stride(1));
}

/// bf16 on the CPU, not to be differentiated: as floats they can be tiled, and their scores need no memory of their own.
bool IsWorthWidening(const Tensor& x) {
  return !at::GradMode::is_enabled() && x.is_cpu() && x.scalar_type() == at::kBFloat16;
}

/// Whether one head's scores fit into the nearest cache: then they are worked on there.
bool IsSmall(const Tensor& q, const Tensor& k) {
  return HasFastGradient(q) && q.size(1) * k.size(1) <= kSmallScores;
}

kernels::TokenRows RowsOf(const Tensor& x) { return {x.data_ptr<float>(), x.stride(1)}; }

}  // namespace

Tensor PlainAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads) {
  const double scale = 1 / std::sqrt(static_cast<double>(q.size(2) / heads));
  const Tensor scores = at::matmul(SplitHeads(q, heads) * scale, SplitHeads(k, heads).transpose(2, 3));
  const Tensor mixed = at::matmul(scores.softmax(-1), SplitHeads(v, heads));
  return mixed.transpose(1, 2).reshape(q.sizes());
}

Tensor Attention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads) {
  RECORD_FUNCTION("evac::attention", (std::vector<c10::IValue>{q, k, v}));  // for profiles: costs nothing otherwise
  if (IsWorthWidening(q)) return Attention(q.to(at::kFloat), k.to(at::kFloat), v.to(at::kFloat), heads).to(q.scalar_type());
  if (!CanBeTiled(q) || !CanBeTiled(k) || !CanBeTiled(v)) {
    if (!IsSmall(q, k)) return PlainAttention(q, k, v, heads);
    return FastAttention(q.unsqueeze(2), k.unsqueeze(2), v.unsqueeze(2), heads).squeeze(2);
  }
  Tensor y = at::empty(q.sizes(), q.options());
  const kernels::AttentionShape shape{q.size(0), q.size(1), k.size(1), heads, q.size(2) / heads};
  kernels::TiledAttention(shape, RowsOf(q), RowsOf(k), RowsOf(v), y.data_ptr<float>());
  return y;
}

Tensor TemporalAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads) {
  RECORD_FUNCTION("evac::temporal_attention", (std::vector<c10::IValue>{q, k, v}));
  const std::int64_t n = q.size(0), t = q.size(1), l = q.size(2), c = q.size(3);
  if (CanUseKernels(q) && CanUseKernels(k) && CanUseKernels(v)) {
    Tensor y = at::empty(q.sizes(), q.options());
    kernels::TemporalAttention({n, t, l, c, heads}, q.data_ptr<float>(), k.data_ptr<float>(), v.data_ptr<float>(),
                               y.data_ptr<float>());
    return y;
  }
  if (HasFastGradient(q)) return FastAttention(q, k, v, heads);
  const auto by_pixel = [&](const Tensor& x) { return x.transpose(1, 2).reshape({n * l, t, c}); };
  const Tensor y = PlainAttention(by_pixel(q), by_pixel(k), by_pixel(v), heads);
  return y.reshape({n, l, t, c}).transpose(1, 2).contiguous();
}

}  // namespace evac::nn
