#pragma once

#include "worldmodel/nn/evac_model.h"

/// Pictures through the codec, so many at a time as memory bears.
namespace evac::nn {

/// How many pictures of so many pixels the codec takes at once: two of the published size, at least one.
std::int64_t PicturesAtOnce(std::int64_t pixels);

/// Pictures [N, 3, H, W] in [-1, 1] → [N, z, h, w], scaled; undefined noise: the posterior's mean.
Tensor EncodeImages(const EvacModel& model, const Tensor& images, const Tensor& noise);
/// Pictures [BV, K, 3, H, W] and noise [BV, K, z, h, w] → [BV, z, K, h, w].
Tensor EncodePoseMaps(const EvacModel& model, const Tensor& maps, const Tensor& noise);
/// [N, z, h, w] → [N, 3, H, W], not clamped.
Tensor DecodeLatents(const EvacModel& model, const Tensor& latents);
/// The same as the image encoder is shown frames that were imagined: in [-1, 1], each number one of 256.
Tensor PicturesShown(const EvacModel& model, const Tensor& latents);

}  // namespace evac::nn
