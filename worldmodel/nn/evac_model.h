#pragma once

#include "worldmodel/nn/image_encoder.h"
#include "worldmodel/nn/noise_schedule.h"
#include "worldmodel/nn/object_forecast.h"
#include "worldmodel/nn/resampler.h"
#include "worldmodel/nn/unet.h"
#include "worldmodel/nn/vae.h"

namespace evac::nn {

/// All networks of EVAC as they lie in one checkpoint.
class EvacModel {
 public:
  /// @throws TensorError if the sizes make no network, or the source lacks a key.
  EvacModel(ParameterSource& source, const ModelConfig& config);

  const ModelConfig& config() const { return config_; }
  const NoiseSchedule& schedule() const { return schedule_; }
  const UNet& unet() const { return unet_; }
  const Vae& vae() const { return vae_; }
  const ImageEncoder& image_encoder() const { return image_encoder_; }
  const Resampler& image_resampler() const { return image_resampler_; }
  const Resampler& action_resampler() const { return action_resampler_; }
  /// Nothing, if the sizes have none.
  const std::optional<ObjectForecast>& object_forecast() const { return object_forecast_; }

  /// @param images  [BV, 3, H, W] in [-1, 1]
  /// @returns       [BV, image tokens, context_dim]
  Tensor ImageTokens(const Tensor& images) const;
  /// @param deltas  [B, any, 14], normalised; if the resampler takes more numbers, the others say which step it is
  /// @returns       [B, action tokens, context_dim]
  Tensor ActionTokens(const Tensor& deltas) const;
  /// Image tokens of each view followed by the scene's action tokens.
  /// @returns  [BV, image tokens + action tokens, context_dim]
  Tensor ContextTokens(const Tensor& image_tokens, const Tensor& action_tokens) const;

 private:
  ModelConfig config_;
  NoiseSchedule schedule_;
  UNet unet_;
  Vae vae_;
  Resampler action_resampler_;
  ImageEncoder image_encoder_;
  Resampler image_resampler_;
  std::optional<ObjectForecast> object_forecast_;
};

inline constexpr const char* kForecastPrefix = "object_forecast";

/// Every key of a checkpoint of these sizes with its shape, in the checkpoint's order; nothing is allocated.
std::vector<ParameterShape> CheckpointKeys(const ModelConfig& config);

}  // namespace evac::nn
