#pragma once

#include <optional>
#include <vector>

#include "worldmodel/nn/layers.h"
#include "worldmodel/nn/model_config.h"

/// The latent codec: AutoencoderKL as in Stable Diffusion (Rombach et al. 2022).
namespace evac::nn {

/// Mean and half the logarithm of the variance of what a picture may be as a latent.
struct Posterior {
  Tensor moments;  ///< [N, 2 z, h, w]: mean, then log variance as the network says it
  /// @param noise  standard normal, [N, z, h, w]; undefined: the mean itself
  /// @returns      [N, z, h, w], not yet scaled
  Tensor Sample(const Tensor& noise) const;
};

class Vae {
 public:
  Vae(const Scope& at, const VaeConfig& config);
  /// @param images  [N, 3, H, W] in [-1, 1]
  Posterior Encode(const Tensor& images) const;
  /// @param latents  [N, z, h, w], scaled
  /// @returns        [N, 3, H, W], about [-1, 1], not clamped
  Tensor Decode(const Tensor& latents) const;
  double scale_factor() const { return config_.scale_factor; }

 private:
  struct ResBlock {
    ResBlock(const Scope& at, std::int64_t in, std::int64_t out);
    Tensor operator()(const Tensor& x) const;
    GroupNorm norm1;
    Conv2d conv1;
    GroupNorm norm2;
    Conv2d conv2;
    std::optional<Linear> shortcut;
  };
  struct Middle {
    Middle(const Scope& at, std::int64_t channels);
    Tensor operator()(const Tensor& x) const;
    ResBlock block1;
    GroupNorm norm;
    Linear q, k, v, out;
    ResBlock block2;
  };
  struct Level {
    std::vector<ResBlock> blocks;
    std::optional<Conv2d> resample;
  };
  struct Encoder {
    Encoder(const Scope& at, const VaeConfig& config);
    Tensor operator()(const Tensor& x) const;
    Conv2d in;
    std::vector<Level> levels;
    Middle middle;
    GroupNorm norm;
    Conv2d out;
  };
  struct Decoder {
    Decoder(const Scope& at, const VaeConfig& config);
    Tensor operator()(const Tensor& z) const;
    Conv2d in;
    Middle middle;
    std::vector<Level> levels;  ///< finest first
    GroupNorm norm;
    Conv2d out;
  };
  static std::vector<Level> EncoderLevels(const Scope& at, const VaeConfig& config);
  static std::vector<Level> DecoderLevels(const Scope& at, const VaeConfig& config);

  VaeConfig config_;
  Encoder encoder_;
  Decoder decoder_;
  Linear quantize_, unquantize_;
};

}  // namespace evac::nn
