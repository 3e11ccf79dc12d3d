#include "worldmodel/nn/vae.h"

#include <ATen/ops/constant_pad_nd.h>
#include <ATen/ops/pixel_shuffle.h>
#include <ATen/ops/pixel_unshuffle.h>

#include <algorithm>

#include "worldmodel/nn/attention.h"

namespace evac::nn {
namespace {

constexpr double kEpsilon = 1e-6;

std::int64_t Deepest(const VaeConfig& config) { return config.channels * config.channel_mult.back(); }

Tensor ToLast(const Tensor& x) { return x.permute({0, 2, 3, 1}).contiguous(); }
Tensor FromLast(const Tensor& x) { return x.permute({0, 3, 1, 2}).contiguous(); }

}  // namespace

Tensor Posterior::Sample(const Tensor& noise) const {
  const std::int64_t z = moments.size(1) / 2;
  const Tensor mean = moments.narrow(1, 0, z);
  if (!noise.defined()) return mean;
  return mean + (moments.narrow(1, z, z).clamp(-30, 20) * 0.5).exp() * noise;
}

Vae::ResBlock::ResBlock(const Scope& at, std::int64_t in, std::int64_t out)
    : norm1(at / "norm1", in, kEpsilon),
      conv1(at / "conv1", in, out),
      norm2(at / "norm2", out, kEpsilon),
      conv2(at / "conv2", out, out),
      shortcut(in == out ? std::nullopt : std::optional(Linear::Pointwise(at / "nin_shortcut", in, out, 2))) {}

Tensor Vae::ResBlock::operator()(const Tensor& x) const {
  const Tensor h = conv2(norm2(conv1(norm1(x, Activation::kSilu)), Activation::kSilu));
  return (shortcut ? (*shortcut)(x) : x) + h;
}

Vae::Middle::Middle(const Scope& at, std::int64_t channels)
    : block1(at / "block_1", channels, channels),
      norm(at / "attn_1" / "norm", channels, kEpsilon),
      q(Linear::Pointwise(at / "attn_1" / "q", channels, channels, 2)),
      k(Linear::Pointwise(at / "attn_1" / "k", channels, channels, 2)),
      v(Linear::Pointwise(at / "attn_1" / "v", channels, channels, 2)),
      out(Linear::Pointwise(at / "attn_1" / "proj_out", channels, channels, 2)),
      block2(at / "block_2", channels, channels) {}

Tensor Vae::Middle::operator()(const Tensor& x) const {
  const Tensor h = block1(x);
  const Tensor tokens = norm(h, Activation::kNone).reshape({h.size(0), -1, h.size(3)});
  const Tensor mixed = out(Attention(q(tokens), k(tokens), v(tokens), 1));
  return block2(h + mixed.reshape(h.sizes()));
}

std::vector<Vae::Level> Vae::EncoderLevels(const Scope& at, const VaeConfig& config) {
  std::vector<Level> levels;
  std::int64_t width = config.channels;
  for (std::size_t i = 0; i < config.channel_mult.size(); ++i) {
    const Scope here = at / static_cast<std::int64_t>(i);
    Level level;
    for (std::int64_t j = 0; j < config.num_res_blocks; ++j) {
      level.blocks.emplace_back(here / "block" / j, width, config.channels * config.channel_mult[i]);
      width = config.channels * config.channel_mult[i];
    }
    if (i + 1 < config.channel_mult.size())
      level.resample.emplace(here / "downsample" / "conv", width, width, Conv2d::Options{.stride = 2, .padding = 0});
    levels.push_back(std::move(level));
  }
  return levels;
}

std::vector<Vae::Level> Vae::DecoderLevels(const Scope& at, const VaeConfig& config) {
  std::vector<Level> levels;
  const std::size_t deepest = config.channel_mult.size() - 1;
  for (std::size_t i = 0; i <= deepest; ++i) {
    const Scope here = at / static_cast<std::int64_t>(i);
    Level level;
    const std::int64_t width = config.channels * config.channel_mult[i];
    std::int64_t from = config.channels * config.channel_mult[std::min(i + 1, deepest)];
    for (std::int64_t j = 0; j <= config.num_res_blocks; ++j) {
      level.blocks.emplace_back(here / "block" / j, from, width);
      from = width;
    }
    if (i > 0) level.resample.emplace(here / "upsample" / "conv", width, width);
    levels.push_back(std::move(level));
  }
  return levels;
}

Vae::Encoder::Encoder(const Scope& at, const VaeConfig& config)
    : in(at / "conv_in", config.image_channels * config.patch_px * config.patch_px, config.channels),
      levels(EncoderLevels(at / "down", config)),
      middle(at / "mid", Deepest(config)),
      norm(at / "norm_out", Deepest(config), kEpsilon),
      out(at / "conv_out", Deepest(config), 2 * config.z_channels) {}

Tensor Vae::Encoder::operator()(const Tensor& x) const {
  Tensor h = in(x);
  for (const Level& level : levels) {
    for (const ResBlock& block : level.blocks) h = block(h);
    if (level.resample) h = (*level.resample)(at::constant_pad_nd(h, {0, 0, 0, 1, 0, 1}));  // right and bottom
  }
  return out(norm(middle(h), Activation::kSilu));
}

Vae::Decoder::Decoder(const Scope& at, const VaeConfig& config)
    : in(at / "conv_in", config.z_channels, Deepest(config)),
      middle(at / "mid", Deepest(config)),
      levels(DecoderLevels(at / "up", config)),
      norm(at / "norm_out", config.channels * config.channel_mult.front(), kEpsilon),
      out(at / "conv_out", config.channels * config.channel_mult.front(),
          config.image_channels * config.patch_px * config.patch_px) {}

Tensor Vae::Decoder::operator()(const Tensor& z) const {
  Tensor h = middle(in(z));
  for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
    for (const ResBlock& block : level->blocks) h = block(h);
    if (level->resample) h = (*level->resample)(UpsampleNearest(h));
  }
  return out(norm(h, Activation::kSilu));
}

Vae::Vae(const Scope& at, const VaeConfig& config)
    : config_(config),
      encoder_(at / "encoder", config),
      decoder_(at / "decoder", config),
      quantize_(Linear::Pointwise(at / "quant_conv", 2 * config.z_channels, 2 * config.z_channels, 2)),
      unquantize_(Linear::Pointwise(at / "post_quant_conv", config.z_channels, config.z_channels, 2)) {}

Posterior Vae::Encode(const Tensor& images) const {
  CheckShape("codec image", images, {-1, config_.image_channels, -1, -1});
  const Tensor patches = config_.patch_px > 1 ? at::pixel_unshuffle(images, config_.patch_px) : images;
  return {FromLast(quantize_(encoder_(ToLast(patches))))};
}

Tensor Vae::Decode(const Tensor& latents) const {
  CheckShape("codec latent", latents, {-1, config_.z_channels, -1, -1});
  const Tensor patches = FromLast(decoder_(unquantize_(ToLast(latents / config_.scale_factor))));
  return config_.patch_px > 1 ? at::pixel_shuffle(patches, config_.patch_px) : patches;
}

}  // namespace evac::nn
