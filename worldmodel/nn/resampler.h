#pragma once

#include <vector>

#include "worldmodel/nn/layers.h"
#include "worldmodel/nn/model_config.h"

namespace evac::nn {

/// A Perceiver resampler (Alayrac et al. 2022, Flamingo): learned queries read any number of inputs. It knows no
/// positions: the order of the inputs is invisible to it.
class Resampler {
 public:
  Resampler(const Scope& at, const ResamplerConfig& config);
  /// @param x  [B, any, embedding_dim]
  /// @returns  [B, queries, output_dim]
  Tensor operator()(const Tensor& x) const;

 private:
  struct Layer {
    Layer(const Scope& at, const ResamplerConfig& config);
    LayerNorm input_norm, latent_norm;
    Linear to_q, to_kv, to_out;
    LayerNorm ff_norm;
    Linear ff_in, ff_out;
  };
  Tensor Attend(const Layer& layer, const Tensor& input, const Tensor& latents) const;

  ResamplerConfig config_;
  Tensor latents_;  ///< [1, queries, dim]
  Linear in_, out_;
  LayerNorm out_norm_;
  std::vector<Layer> layers_;
};

}  // namespace evac::nn
