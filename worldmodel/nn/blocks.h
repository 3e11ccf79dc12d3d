#pragma once

#include <optional>
#include <vector>

#include "worldmodel/nn/layers.h"

/// The convolutional blocks of the denoiser, as the reference has them (docs/evac_quirks.md).
namespace evac::nn {

/// How the first axis of a picture tensor is to be read: rows are (scene, view, frame), frame fastest.
struct FrameLayout {
  std::int64_t scenes = 1;
  std::int64_t views = 1;
  std::int64_t frames = 1;
  std::int64_t Rows() const { return scenes * views * frames; }
};

/// cos then sin of t times 10000^(-j / half), j = 0 … half - 1.
/// @param t  [N], any number type
/// @returns  [N, channels], float
Tensor SinusoidEmbedding(const Tensor& t, std::int64_t channels);

/// Linear, SiLU, Linear.
class EmbeddingMlp {
 public:
  EmbeddingMlp(const Scope& at, std::int64_t in, std::int64_t out);
  Tensor operator()(const Tensor& x) const;

 private:
  Linear first_, second_;
};

/// Four causal convolutions over time, added to what came in. The norms see all frames.
class TemporalConv {
 public:
  TemporalConv(const Scope& at, std::int64_t channels);
  Tensor operator()(const Tensor& x, const FrameLayout& layout) const;

 private:
  struct Stage {
    Stage(const Scope& at, std::int64_t channels, std::int64_t conv_index);
    GroupNorm norm;
    CausalConv conv;
  };
  std::vector<Stage> stages_;
};

class ResBlock {
 public:
  struct Sizes {
    std::int64_t in = 0, out = 0, embedding = 0;
  };
  ResBlock(const Scope& at, const Sizes& sizes);
  /// @param x          [rows, H, W, in]
  /// @param embedding  [rows, E], SiLU already applied
  Tensor operator()(const Tensor& x, const Tensor& embedding, const FrameLayout& layout) const;

 private:
  GroupNorm in_norm_;
  Conv2d in_conv_;
  Linear embedding_;
  GroupNorm out_norm_;
  Conv2d out_conv_;
  std::optional<Linear> skip_;
  TemporalConv temporal_;
};

}  // namespace evac::nn
