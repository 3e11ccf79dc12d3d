#include "worldmodel/nn/pictures.h"

#include <ATen/ops/_upsample_bilinear2d_aa.h>

namespace evac::nn {

Tensor ResizeAntialiased(const Tensor& images, std::int64_t height, std::int64_t width) {
  return at::_upsample_bilinear2d_aa(images.contiguous(), {height, width}, /*align_corners=*/false);
}

Tensor ToNetworkRange(const Tensor& images) { return (images - 0.5) / 0.5; }

Tensor ToBytes(const Tensor& images) { return (((images + 1) / 2).clamp(0, 1) * 255).round().to(at::kByte); }

}  // namespace evac::nn
