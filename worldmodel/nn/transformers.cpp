#include "worldmodel/nn/transformers.h"

#include <ATen/record_function.h>

#include <algorithm>

#include "worldmodel/nn/attention.h"
#include "worldmodel/nn/differentiable.h"
#include "worldmodel/nn/kernels.h"

namespace evac::nn {
namespace {

constexpr double kTransformerEpsilon = 1e-6;
constexpr Linear::Bias kNoBias = Linear::Bias::kNo;

/// (scene view frame) h w c → (scene frame) view h w c; nothing to do for one view.
Tensor ViewsTogether(const Tensor& x, const FrameLayout& layout) {
  const std::int64_t h = x.size(1), w = x.size(2), c = x.size(3);
  if (layout.views == 1) return x.reshape({layout.scenes * layout.frames, h * w, c});
  return x.reshape({layout.scenes, layout.views, layout.frames, h * w, c})
      .transpose(1, 2)
      .reshape({layout.scenes * layout.frames, layout.views * h * w, c});
}

Tensor ViewsApart(const Tensor& tokens, at::IntArrayRef picture, const FrameLayout& layout) {
  if (layout.views == 1) return tokens.reshape(picture);
  return tokens.reshape({layout.scenes, layout.frames, layout.views, -1, tokens.size(-1)})
      .transpose(1, 2)
      .reshape(picture);
}

/// The first half of the channels, weighted by the second.
Tensor Gated(const Tensor& both) {
  RECORD_FUNCTION("evac::gated_gelu", {});
  const std::int64_t half = both.size(-1) / 2;
  Tensor gated = at::empty({both.size(0), half}, both.options());
  kernels::GatedGelu(both.size(0), half, both.data_ptr<float>(), gated.data_ptr<float>());
  return gated;
}

}  // namespace

FeedForward::FeedForward(const Scope& at, std::int64_t channels)
    : in_(at / "net" / "0" / "proj", channels, 8 * channels), out_(at / "net" / "2", 4 * channels, channels) {}

Tensor FeedForward::operator()(const Tensor& x) const {
  if (!CanUseKernels(x)) {
    const Tensor both = in_(x);
    const std::int64_t half = both.size(-1) / 2;
    if (HasFastGradient(both)) return out_(FastGatedGelu(both));
  return out_(both.narrow(-1, 0, half) * at::gelu(both.narrow(-1, half, half)));
  }
  constexpr std::int64_t kRows = 4096;  // at a time: what lies between the products is eight times as wide as x
  const Tensor rows = x.view({-1, x.size(-1)});
  Tensor y = at::empty(rows.sizes(), rows.options());
  for (std::int64_t from = 0; from < rows.size(0); from += kRows) {
    const std::int64_t count = std::min(kRows, rows.size(0) - from);
    y.narrow(0, from, count).copy_(out_(Gated(in_(rows.narrow(0, from, count)))));
  }
  return y.view(x.sizes());
}

AttentionLayer::AttentionLayer(const Scope& at, std::int64_t channels, std::int64_t context_dim)
    : to_q_(at / "to_q", channels, channels, kNoBias),
      to_k_(at / "to_k", context_dim, channels, kNoBias),
      to_v_(at / "to_v", context_dim, channels, kNoBias),
      to_out_(at / "to_out" / "0", channels, channels) {}

SpatialTransformer::Layer::Layer(const Scope& at, const Sizes& sizes)
    : self(at / "attn1", sizes.channels, sizes.channels),
      feed_forward(at / "ff", sizes.channels),
      cross_q(at / "attn2" / "to_q", sizes.channels, sizes.channels, kNoBias),
      dead_k(at / "attn2" / "to_k", sizes.context_dim, sizes.channels, kNoBias),
      dead_v(at / "attn2" / "to_v", sizes.context_dim, sizes.channels, kNoBias),
      cross_out(at / "attn2" / "to_out" / "0", sizes.channels, sizes.channels),
      image_k(at / "attn2" / "to_k_ip", sizes.context_dim, sizes.channels, kNoBias),
      image_v(at / "attn2" / "to_v_ip", sizes.context_dim, sizes.channels, kNoBias),
      action_k(at / "attn2" / "to_k_tp", sizes.context_dim, sizes.channels, kNoBias),
      action_v(at / "attn2" / "to_v_tp", sizes.context_dim, sizes.channels, kNoBias),
      norm1(at / "norm1", sizes.channels),
      norm2(at / "norm2", sizes.channels),
      norm3(at / "norm3", sizes.channels) {}

SpatialTransformer::SpatialTransformer(const Scope& at, const Sizes& sizes)
    : sizes_(sizes),
      norm_(at / "norm", sizes.channels, kTransformerEpsilon),
      in_(at / "proj_in", sizes.channels, sizes.channels),
      layers_([&] {
        std::vector<Layer> layers;
        for (std::int64_t i = 0; i < sizes.depth; ++i) layers.emplace_back(at / "transformer_blocks" / i, sizes);
        return layers;
      }()),
      out_(at / "proj_out", sizes.channels, sizes.channels) {}

std::vector<KeyValue> SpatialTransformer::Prepare(const Tensor& tokens) const {
  std::vector<KeyValue> context;
  for (const Layer& layer : layers_) {
    const bool image = sizes_.listens == Listens::kImage;
    context.push_back(
        {(image ? layer.image_k : layer.action_k)(tokens), (image ? layer.image_v : layer.action_v)(tokens)});
  }
  return context;
}

Tensor SpatialTransformer::operator()(const Tensor& x, std::span<const KeyValue> context,
                                      const FrameLayout& layout) const {
  const Tensor in = ViewsTogether(x, layout);  // [BT, V h w, C]
  Tensor tokens = in_(norm_(in, Activation::kNone));
  const std::int64_t scenes = layout.scenes, c = sizes_.channels;
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const Layer& layer = layers_[i];
    const Tensor y = layer.norm1(tokens);
    tokens =
        tokens + layer.self.Out(Attention(layer.self.Query(y), layer.self.Key(y), layer.self.Value(y), sizes_.heads));
    // The context is the same for every frame: all frames of a scene are one row of queries.
    const Tensor query = layer.cross_q(layer.norm2(tokens)).reshape({scenes, -1, c});
    const Tensor heard = Attention(query, context[i].key, context[i].value, sizes_.heads);
    tokens = tokens + layer.cross_out(heard.reshape(tokens.sizes()));
    tokens = tokens + layer.feed_forward(layer.norm3(tokens));
  }
  return ViewsApart(out_(tokens) + in, x.sizes(), layout);
}

TemporalTransformer::Layer::Layer(const Scope& at, std::int64_t channels)
    : attention1(at / "attn1", channels, channels),
      feed_forward(at / "ff", channels),
      attention2(at / "attn2", channels, channels),
      norm1(at / "norm1", channels),
      norm2(at / "norm2", channels),
      norm3(at / "norm3", channels) {}

TemporalTransformer::TemporalTransformer(const Scope& at, const Sizes& sizes)
    : sizes_(sizes),
      norm_(at / "norm", sizes.channels, kTransformerEpsilon),
      in_(Linear::Pointwise(at / "proj_in", sizes.channels, sizes.inner, sizes.convolutional ? 1 : 0)),
      layers_([&] {
        std::vector<Layer> layers;
        for (std::int64_t i = 0; i < sizes.depth; ++i) layers.emplace_back(at / "transformer_blocks" / i, sizes.inner);
        return layers;
      }()),
      out_(Linear::Pointwise(at / "proj_out", sizes.inner, sizes.channels, sizes.convolutional ? 1 : 0)) {}

Tensor TemporalTransformer::operator()(const Tensor& x, const FrameLayout& layout) const {
  const Tensor by_scene = x.reshape({layout.scenes, -1, x.size(-1)});  // the norm sees all views and frames together
  Tensor tokens = in_(norm_(by_scene, Activation::kNone))
                      .reshape({layout.scenes * layout.views, layout.frames, -1, sizes_.inner});  // [BV, T, HW, C]
  const auto attend = [&](const AttentionLayer& layer, const Tensor& y) {
    return layer.Out(TemporalAttention(layer.Query(y), layer.Key(y), layer.Value(y), sizes_.heads));
  };
  for (const Layer& layer : layers_) {
    tokens = tokens + attend(layer.attention1, layer.norm1(tokens));
    tokens = tokens + attend(layer.attention2, layer.norm2(tokens));
    tokens = tokens + layer.feed_forward(layer.norm3(tokens));
  }
  return out_(tokens).reshape(x.sizes()) + x;
}

}  // namespace evac::nn
