#pragma once

#include <vector>

#include "worldmodel/nn/blocks.h"

/// The attention blocks of the denoiser, as the reference has them (docs/evac_quirks.md).
namespace evac::nn {

/// Keys and values of a context that does not change while a chunk is denoised.
struct KeyValue {
  Tensor key, value;  ///< [B, M, C]
};

/// Linear to twice 4C, value times GELU of gate, Linear back.
class FeedForward {
 public:
  FeedForward(const Scope& at, std::int64_t channels);
  Tensor operator()(const Tensor& x) const;

 private:
  Linear in_, out_;
};

/// Queries, keys and values of one attention, without the attention.
class AttentionLayer {
 public:
  AttentionLayer(const Scope& at, std::int64_t channels, std::int64_t context_dim);
  Tensor Query(const Tensor& x) const { return to_q_(x); }
  Tensor Key(const Tensor& context) const { return to_k_(context); }
  Tensor Value(const Tensor& context) const { return to_v_(context); }
  Tensor Out(const Tensor& x) const { return to_out_(x); }

 private:
  Linear to_q_, to_k_, to_v_, to_out_;
};

/// Which part of the context a spatial transformer attends to: they alternate, the first one to the actions.
enum class Listens { kActions, kImage };

/// Attention over all pixels of all views of one frame, then to the context.
class SpatialTransformer {
 public:
  struct Sizes {
    std::int64_t channels = 0, heads = 0, depth = 1, context_dim = 0;
    Listens listens = Listens::kActions;
  };
  SpatialTransformer(const Scope& at, const Sizes& sizes);
  /// @param tokens  [B, M, context_dim], of the part it listens to
  /// @returns one per layer of depth
  std::vector<KeyValue> Prepare(const Tensor& tokens) const;
  Listens listens() const { return sizes_.listens; }
  /// @param x  [rows, H, W, C]
  Tensor operator()(const Tensor& x, std::span<const KeyValue> context, const FrameLayout& layout) const;

 private:
  struct Layer {
    Layer(const Scope& at, const Sizes& sizes);
    AttentionLayer self;
    FeedForward feed_forward;
    Linear cross_q, dead_k, dead_v, cross_out;  ///< the checkpoint carries keys and values that nothing reads
    Linear image_k, image_v, action_k, action_v;
    LayerNorm norm1, norm2, norm3;
  };
  Sizes sizes_;
  GroupNorm norm_;
  Linear in_;
  std::vector<Layer> layers_;
  Linear out_;
};

/// Attention of every pixel to itself over time, twice. It knows no positions: order comes from the causal
/// convolutions.
class TemporalTransformer {
 public:
  struct Sizes {
    std::int64_t channels = 0, inner = 0, heads = 0, depth = 1;
    bool convolutional = false;  ///< projections lie in the checkpoint as 1x1 convolutions
  };
  TemporalTransformer(const Scope& at, const Sizes& sizes);
  /// @param x  [rows, H, W, C]
  Tensor operator()(const Tensor& x, const FrameLayout& layout) const;

 private:
  struct Layer {
    Layer(const Scope& at, std::int64_t channels);
    AttentionLayer attention1;
    FeedForward feed_forward;
    AttentionLayer attention2;
    LayerNorm norm1, norm2, norm3;
  };
  Sizes sizes_;
  GroupNorm norm_;
  Linear in_;
  std::vector<Layer> layers_;
  Linear out_;
};

}  // namespace evac::nn
