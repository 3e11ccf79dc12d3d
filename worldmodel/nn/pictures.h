#pragma once

#include "worldmodel/nn/tensor.h"

/// Pictures as the network takes and gives them.
namespace evac::nn {

/// Bilinear, pixel centres at halves, averaging over what a smaller picture cannot show (antialias).
/// @param images  [N, 3, H, W]
/// @returns       [N, 3, height, width]
Tensor ResizeAntialiased(const Tensor& images, std::int64_t height, std::int64_t width);

/// [0, 1] → [-1, 1]
Tensor ToNetworkRange(const Tensor& images);

/// About [-1, 1] → 0 … 255, rounded, bytes.
Tensor ToBytes(const Tensor& images);

}  // namespace evac::nn
