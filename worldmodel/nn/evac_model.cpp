#include "worldmodel/nn/evac_model.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kDeltaNumbers = 14;

const ModelConfig& Checked(const ModelConfig& config) {
  config.Check();
  return config;
}

UNetConfig WithTokens(const ModelConfig& config) {
  UNetConfig unet = config.unet;
  unet.image_tokens = config.image_resampler.queries;
  unet.action_tokens = config.action_resampler.queries;
  return unet;
}

}  // namespace

EvacModel::EvacModel(ParameterSource& source, const ModelConfig& config)
    : config_(Checked(config)),
      schedule_(config.schedule),
      unet_(Scope(source, "model.diffusion_model"), WithTokens(config)),
      vae_(Scope(source, "first_stage_model"), config.vae),
      action_resampler_(Scope(source, "cond_stage_model"), config.action_resampler),
      image_encoder_(MakeImageEncoder(Scope(source, "embedder.model"), config.image_encoder)),
      image_resampler_(Scope(source, "image_proj_model"), config.image_resampler) {
  if (config.object_forecast) object_forecast_.emplace(Scope(source, kForecastPrefix), config);
}

Tensor EvacModel::ImageTokens(const Tensor& images) const {
  return image_resampler_(image_encoder_(PreprocessForEncoder(images, image_encoder_.image_px())));
}

Tensor EvacModel::ActionTokens(const Tensor& deltas) const {
  const std::int64_t order = config_.action_resampler.embedding_dim - kDeltaNumbers;
  if (order == 0) return action_resampler_(deltas);
  const Tensor place = SinusoidEmbedding(at::arange(deltas.size(1), deltas.options()), order);
  return action_resampler_(at::cat({deltas, place.expand({deltas.size(0), deltas.size(1), order})}, 2));
}

Tensor EvacModel::ContextTokens(const Tensor& image_tokens, const Tensor& action_tokens) const {
  const std::int64_t views = image_tokens.size(0) / action_tokens.size(0);
  return at::cat({image_tokens, action_tokens.repeat_interleave(views, 0)}, 1);
}

std::vector<ParameterShape> CheckpointKeys(const ModelConfig& config) {
  KeyList list;
  for (const NoiseSchedule::Buffer& buffer : NoiseSchedule(config.schedule).Buffers())
    list.Take(buffer.key, {static_cast<std::int64_t>(buffer.values.size())});
  EvacModel(list, config);
  return list.keys();
}

}  // namespace evac::nn
