#include "worldmodel/nn/image_encoder.h"

#include <ATen/ops/reflection_pad2d.h>
#include <ATen/ops/upsample_bicubic2d.h>

#include <algorithm>
#include <cmath>

#include "worldmodel/nn/attention.h"

namespace evac::nn {
namespace {

/// Weights of a Gaussian that takes out what a picture `factor` times smaller cannot show.
std::vector<float> BlurKernel(double factor) {
  const double sigma = std::max((factor - 1) / 2, 0.001);
  int size = static_cast<int>(std::max(4 * sigma, 3.0));
  size += size % 2 == 0 ? 1 : 0;
  std::vector<float> kernel(static_cast<std::size_t>(size));
  double sum = 0;
  const auto weight = [&](int i) { return std::exp(-(i - size / 2) * (i - size / 2) / (2 * sigma * sigma)); };
  for (int i = 0; i < size; ++i) sum += weight(i);
  for (int i = 0; i < size; ++i) kernel[static_cast<std::size_t>(i)] = static_cast<float>(weight(i) / sum);
  return kernel;
}

/// Each channel blurred along one side, reflected at the borders.
Tensor BlurAlong(const Tensor& images, const std::vector<float>& kernel, bool along_width) {
  const auto size = static_cast<std::int64_t>(kernel.size());
  const std::int64_t n = images.size(0), c = images.size(1), h = images.size(2), w = images.size(3), pad = size / 2;
  const std::vector<std::int64_t> shape =
      along_width ? std::vector<std::int64_t>{1, 1, 1, size} : std::vector<std::int64_t>{1, 1, size, 1};
  const Tensor weight = at::tensor(kernel).reshape(shape).to(images.options());
  const Tensor padded =
      at::reflection_pad2d(images.reshape({n * c, 1, h, w}),
                           along_width ? at::IntArrayRef{pad, pad, 0, 0} : at::IntArrayRef{0, 0, pad, pad});
  return at::conv2d(padded, weight).reshape({n, c, h, w});
}

Tensor PerChannel(std::initializer_list<float> values, const Tensor& like) {
  return at::tensor(std::vector<float>(values)).to(like.options()).reshape({1, 3, 1, 1});
}

}  // namespace

Tensor PreprocessForEncoder(const Tensor& images, std::int64_t side_px) {
  CheckShape("encoder image", images, {-1, 3, -1, -1});
  Tensor x = images;
  const double fy = static_cast<double>(x.size(2)) / static_cast<double>(side_px);
  const double fx = static_cast<double>(x.size(3)) / static_cast<double>(side_px);
  if (std::max(fx, fy) > 1) x = BlurAlong(BlurAlong(x, BlurKernel(fx), true), BlurKernel(fy), false);
  x = at::upsample_bicubic2d(x, {side_px, side_px}, true);
  const Tensor mean = PerChannel({0.48145466F, 0.4578275F, 0.40821073F}, x);
  const Tensor deviation = PerChannel({0.26862954F, 0.26130258F, 0.27577711F}, x);
  return ((x + 1) / 2 - mean) / deviation;
}

ImageEncoder::Block::Block(const Scope& at, std::int64_t width)
    : norm1(at / "ln_1", width),
      qkv_weight(at.Take("attn.in_proj_weight", {3 * width, width})),
      qkv_bias(at.Take("attn.in_proj_bias", {3 * width})),
      out(at / "attn" / "out_proj", width, width),
      norm2(at / "ln_2", width),
      mlp_in(at / "mlp" / "c_fc", width, 4 * width),
      mlp_out(at / "mlp" / "c_proj", 4 * width, width) {}

ImageEncoder::ImageEncoder(const Scope& at, const ImageEncoderConfig& config)
    : config_(config),
      class_embedding_(Precise(at.Take("class_embedding", {config.width}))),
      positional_embedding_(Precise(at.Take("positional_embedding", {config.Tokens(), config.width}))) {
  at.Take("proj", {config.width, config.embed_dim});
  patch_weight_ = Precise(at.Take("conv1.weight", {config.width, 3, config.patch_px, config.patch_px}));
  norm_.emplace_back(at / "ln_pre", config.width);
  for (std::int64_t i = 0; i < config.layers; ++i)
    blocks_.emplace_back(at / "transformer" / "resblocks" / i, config.width);
  LayerNorm(at / "ln_post", config.width);
}

Tensor ImageEncoder::Run(const Block& block, const Tensor& x) const {
  const std::int64_t width = config_.width;
  const Tensor seen = block.norm1(x).to(block.qkv_weight.scalar_type());
  const Tensor qkv = at::linear(seen, block.qkv_weight, block.qkv_bias).to(x.scalar_type());
  const Tensor mixed = Attention(qkv.narrow(2, 0, width), qkv.narrow(2, width, width), qkv.narrow(2, 2 * width, width),
                                 width / config_.head_width);
  const Tensor y = x + block.out(mixed);
  return y + block.mlp_out(at::gelu(block.mlp_in(block.norm2(y))));
}

Tensor ImageEncoder::operator()(const Tensor& preprocessed) const {
  CheckShape("encoder input", preprocessed, {-1, 3, config_.image_px, config_.image_px});
  const Tensor patches = at::conv2d(preprocessed, patch_weight_, {}, config_.patch_px).flatten(2).transpose(1, 2);
  const Tensor first = class_embedding_.expand({preprocessed.size(0), 1, config_.width});
  Tensor x = norm_.front()(at::cat({first, patches}, 1) + positional_embedding_);
  for (const Block& block : blocks_) x = Run(block, x);
  return x;
}

ImageEncoder MakeImageEncoder(const Scope& at, const ImageEncoderConfig& config) {
  at.Take("positional_embedding", {config.text_length, config.embed_dim});
  at.Take("text_projection", {config.embed_dim, config.embed_dim});
  at.Take("logit_scale", {});
  ImageEncoder encoder(at / "visual", config);
  at.Take("token_embedding.weight", {config.vocabulary, config.embed_dim});
  LayerNorm(at / "ln_final", config.embed_dim);
  return encoder;
}

}  // namespace evac::nn
