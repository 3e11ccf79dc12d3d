#include "worldmodel/nn/resampler.h"

#include "worldmodel/nn/attention.h"

namespace evac::nn {
namespace {
constexpr Linear::Bias kNoBias = Linear::Bias::kNo;
}  // namespace

Resampler::Layer::Layer(const Scope& at, const ResamplerConfig& config)
    : input_norm(at / 0 / "norm1", config.dim),
      latent_norm(at / 0 / "norm2", config.dim),
      to_q(at / 0 / "to_q", config.dim, config.heads * config.dim_head, kNoBias),
      to_kv(at / 0 / "to_kv", config.dim, 2 * config.heads * config.dim_head, kNoBias),
      to_out(at / 0 / "to_out", config.heads * config.dim_head, config.dim, kNoBias),
      ff_norm(at / 1 / 0, config.dim),
      ff_in(at / 1 / 1, config.dim, config.ff_mult * config.dim, kNoBias),
      ff_out(at / 1 / 3, config.ff_mult * config.dim, config.dim, kNoBias) {}

Resampler::Resampler(const Scope& at, const ResamplerConfig& config)
    : config_(config),
      latents_(Precise(at.Take("latents", {1, config.queries, config.dim}))),
      in_(at / "proj_in", config.embedding_dim, config.dim),
      out_(at / "proj_out", config.dim, config.output_dim),
      out_norm_(at / "norm_out", config.output_dim) {
  for (std::int64_t i = 0; i < config.depth; ++i) layers_.emplace_back(at / "layers" / i, config);
}

Tensor Resampler::Attend(const Layer& layer, const Tensor& input, const Tensor& latents) const {
  const Tensor queries = layer.latent_norm(latents);
  const Tensor both = layer.to_kv(at::cat({layer.input_norm(input), queries}, 1));
  const std::int64_t inner = config_.heads * config_.dim_head;
  return layer.to_out(
      Attention(layer.to_q(queries), both.narrow(2, 0, inner), both.narrow(2, inner, inner), config_.heads));
}

Tensor Resampler::operator()(const Tensor& x) const {
  CheckShape("resampler input", x, {-1, -1, config_.embedding_dim});
  const Tensor input = in_(x);
  Tensor latents = latents_.expand({x.size(0), config_.queries, config_.dim});
  for (const Layer& layer : layers_) {
    latents = Attend(layer, input, latents) + latents;
    latents = layer.ff_out(at::gelu(layer.ff_in(layer.ff_norm(latents)))) + latents;
  }
  return out_norm_(out_(latents));
}

}  // namespace evac::nn
