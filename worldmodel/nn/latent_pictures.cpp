#include "worldmodel/nn/latent_pictures.h"

#include <algorithm>

#include "worldmodel/nn/pictures.h"

namespace evac::nn {
namespace {

/// `count` pictures of `pixels` each through `function`, so many at a time as memory bears.
template <typename Function>
Tensor InBatches(std::int64_t count, std::int64_t pixels, Function function) {
  const std::int64_t batch = PicturesAtOnce(pixels);
  std::vector<Tensor> parts;
  for (std::int64_t from = 0; from < count; from += batch)
    parts.push_back(function(from, std::min(batch, count - from)));
  return at::cat(parts, 0);
}

}  // namespace

std::int64_t PicturesAtOnce(std::int64_t pixels) { return std::max<std::int64_t>(1, std::int64_t{2} * 320 * 512 / pixels); }

Tensor EncodeImages(const EvacModel& model, const Tensor& images, const Tensor& noise) {
  return InBatches(images.size(0), images.size(2) * images.size(3), [&](std::int64_t from, std::int64_t count) {
    const Posterior posterior = model.vae().Encode(images.narrow(0, from, count));
    return posterior.Sample(noise.defined() ? noise.narrow(0, from, count) : noise) * model.vae().scale_factor();
  });
}

Tensor EncodePoseMaps(const EvacModel& model, const Tensor& maps, const Tensor& noise) {
  const Tensor encoded = EncodeImages(model, maps.flatten(0, 1), noise.defined() ? noise.flatten(0, 1) : noise);
  return encoded.unflatten(0, {maps.size(0), maps.size(1)}).transpose(1, 2).contiguous();
}

Tensor DecodeLatents(const EvacModel& model, const Tensor& latents) {
  const std::int64_t stride = model.config().vae.Stride();
  return InBatches(
      latents.size(0), latents.size(2) * latents.size(3) * stride * stride,
      [&](std::int64_t from, std::int64_t count) { return model.vae().Decode(latents.narrow(0, from, count)); });
}

Tensor PicturesShown(const EvacModel& model, const Tensor& latents) {
  return ToNetworkRange(ToBytes(DecodeLatents(model, latents)).to(at::kFloat) / 255);
}

}  // namespace evac::nn
