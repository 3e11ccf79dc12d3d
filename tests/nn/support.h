#pragma once

#include <ATen/CPUGeneratorImpl.h>
#include <ATen/ops/randn.h>

#include "worldmodel/nn/evac_model.h"

namespace evac::nn {

/// Every kind of layer, two levels, small enough to run in milliseconds.
inline ModelConfig TinyConfig() {
  ModelConfig config;
  config.unet.model_channels = 32;
  config.unet.channel_mult = {1, 2};
  config.unet.num_res_blocks = 1;
  config.unet.attention_resolutions = {1, 2};
  config.unet.num_head_channels = 16;
  config.unet.context_dim = 32;
  config.unet.init_attention_heads = 2;
  config.unet.image_tokens = 4;
  config.unet.action_tokens = 3;
  config.vae.channels = 32;
  config.vae.channel_mult = {1, 1};
  config.vae.num_res_blocks = 1;
  config.action_resampler = {
      .embedding_dim = 14, .queries = 3, .dim = 32, .depth = 1, .dim_head = 16, .heads = 2, .output_dim = 32};
  config.image_resampler = {
      .embedding_dim = 32, .queries = 4, .dim = 32, .depth = 1, .dim_head = 16, .heads = 2, .output_dim = 32};
  config.image_encoder = {
      .width = 32, .layers = 1, .head_width = 16, .patch_px = 14, .image_px = 28, .embed_dim = 16, .vocabulary = 8};
  config.chunk = 3;
  config.memory = 2;
  config.image_height_px = 16;
  config.image_width_px = 24;
  return config;
}

/// Standard normal numbers that depend on the seed alone.
inline Tensor Noise(at::IntArrayRef shape, std::uint64_t seed) {
  at::Generator generator = at::detail::createCPUGenerator(seed);
  return at::randn(shape, generator, at::TensorOptions().dtype(at::kFloat));
}

inline double LargestDifference(const Tensor& a, const Tensor& b) {
  return (a.to(at::kDouble) - b.to(at::kDouble)).abs().max().item<double>();
}

}  // namespace evac::nn
