#pragma once

#include <vector>

#include "worldmodel/nn/layers.h"
#include "worldmodel/nn/model_config.h"

namespace evac::nn {

/// A picture of any size as the encoder's input: blurred against aliasing where it shrinks, bicubic with corners
/// aligned, normalised: as the reference does (docs/evac_quirks.md).
/// @param images  [N, 3, H, W] in [-1, 1]
/// @returns       [N, 3, side_px, side_px]
Tensor PreprocessForEncoder(const Tensor& images, std::int64_t side_px);

/// The visual tower of CLIP: all tokens of the last block, neither normalised nor projected.
class ImageEncoder {
 public:
  ImageEncoder(const Scope& at, const ImageEncoderConfig& config);
  /// @param preprocessed  [N, 3, image_px, image_px]
  /// @returns             [N, 1 + patches, width]: class token first
  Tensor operator()(const Tensor& preprocessed) const;
  std::int64_t image_px() const { return config_.image_px; }

 private:
  struct Block {
    Block(const Scope& at, std::int64_t width);
    LayerNorm norm1;
    Tensor qkv_weight, qkv_bias;  ///< [3 width, width], [3 width]
    Linear out;
    LayerNorm norm2;
    Linear mlp_in, mlp_out;
  };
  Tensor Run(const Block& block, const Tensor& x) const;

  ImageEncoderConfig config_;
  Tensor class_embedding_;       ///< [width]
  Tensor positional_embedding_;  ///< [tokens, width]
  Tensor patch_weight_;          ///< [width, 3, patch, patch]
  std::vector<LayerNorm> norm_;  ///< one: before the blocks
  std::vector<Block> blocks_;
};

/// Every key of the CLIP that a checkpoint carries: the visual tower, and leftovers that nothing reads.
ImageEncoder MakeImageEncoder(const Scope& at, const ImageEncoderConfig& config);

}  // namespace evac::nn
