#include "worldmodel/nn/blocks.h"

#include <cmath>

namespace evac::nn {
namespace {
constexpr double kBlockEpsilon = 1e-5;
}  // namespace

Tensor SinusoidEmbedding(const Tensor& t, std::int64_t channels) {
  const std::int64_t half = channels / 2;
  const Tensor index = at::arange(half, t.options().dtype(at::kFloat));
  const Tensor frequencies = (index * (-std::log(10000.0)) / half).exp();
  const Tensor angles = t.to(at::kFloat).unsqueeze(1) * frequencies.unsqueeze(0);
  return at::cat({angles.cos(), angles.sin()}, 1);
}

EmbeddingMlp::EmbeddingMlp(const Scope& at, std::int64_t in, std::int64_t out)
    : first_(at / "0", in, out), second_(at / "2", out, out) {}

Tensor EmbeddingMlp::operator()(const Tensor& x) const { return second_(at::silu(first_(x))); }

TemporalConv::Stage::Stage(const Scope& at, std::int64_t channels, std::int64_t conv_index)
    : norm(at / "0", channels, kBlockEpsilon), conv(at / conv_index, channels) {}

TemporalConv::TemporalConv(const Scope& at, std::int64_t channels) {
  stages_.emplace_back(at / "conv1", channels, 2);
  for (const char* name : {"conv2", "conv3", "conv4"}) stages_.emplace_back(at / name, channels, 3);  // 2 is dropout
}

Tensor TemporalConv::operator()(const Tensor& x, const FrameLayout& layout) const {
  const Tensor in = x.reshape({layout.scenes * layout.views, layout.frames, -1, x.size(-1)});  // [BV, T, HW, C]
  Tensor y = in;
  for (const Stage& stage : stages_) y = stage.conv(stage.norm(y, Activation::kSilu));
  return (in + y).reshape(x.sizes());
}

ResBlock::ResBlock(const Scope& at, const Sizes& sizes)
    : in_norm_(at / "in_layers" / "0", sizes.in, kBlockEpsilon),
      in_conv_(at / "in_layers" / "2", sizes.in, sizes.out),
      embedding_(at / "emb_layers" / "1", sizes.embedding, sizes.out),
      out_norm_(at / "out_layers" / "0", sizes.out, kBlockEpsilon),
      out_conv_(at / "out_layers" / "3", sizes.out, sizes.out),
      skip_(sizes.in == sizes.out ? std::nullopt
                                  : std::optional(Linear::Pointwise(at / "skip_connection", sizes.in, sizes.out, 2))),
      temporal_(at / "temopral_conv", sizes.out) {}  // spelt so in the checkpoint

Tensor ResBlock::operator()(const Tensor& x, const Tensor& embedding, const FrameLayout& layout) const {
  Tensor h = in_conv_(in_norm_(x, Activation::kSilu));
  h = h + embedding_(embedding).unsqueeze(1).unsqueeze(1);
  h = out_conv_(out_norm_(h, Activation::kSilu));
  h = (skip_ ? (*skip_)(x) : x) + h;
  return temporal_(h, layout);
}

}  // namespace evac::nn
