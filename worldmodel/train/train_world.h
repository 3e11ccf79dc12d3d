#pragma once

#include "worldmodel/train/strips.h"
#include "worldmodel/train/train_codec.h"

namespace evac::train {

/// Where the first weights come from.
struct WorldStart {
  std::filesystem::path codec;  ///< of OUT/codec.safetensors, or a whole checkpoint whose codec is meant
  std::filesystem::path init = {};  ///< a checkpoint to go on from, every key of which must fit; empty: random
  /// Of `init`: keys that begin so are drawn anew ("model.diffusion_model.out." for another number of channels), or left
  /// behind where the page has none. What `codec` and `forecast` give is taken from them all the same. With
  /// "alphas_cumprod" or "scale_arr" among them the noise may be another than `init` learned from.
  std::vector<std::string> init_except = {};
  bool init_widen = false;  ///< `init` is of a model that was shown less (WidenedWeights)
  std::filesystem::path forecast = {};  ///< of OUT/forecast.safetensors; empty: `init` has one, or the sizes have none
  std::string codec_sha256 = {};  ///< what the latents must have been made with; empty: not asked
};

/// @throws TensorError if the sizes have an `object_forecast` and nothing gives one, or one is given that they have not;
///   if an exception begins no key that `init` gives; if a key of `init` that is not excepted is missing, is none of the
///   network's or has another shape, by name; or if its noise schedule is another (nn::CompareSchedule), or, where its
///   card says it (nn::CompareSizes), heads of attention, `vae.scale_factor`, `schedule.from_last_frame` (not where the
///   last layer is excepted) or, with `init_widen` or where `init` gives the forecast, `schedule.carry_plane_m`.
void CheckStart(const nn::ModelConfig& config, const WorldStart& start);

/// What weights are for, as the shards that they learned from say, for the weights' metadata: period_s, cameras, arms,
/// arms_read, pose_map, statistics, tasks. What they are asked for is compared with period, cameras, arms, maps and
/// statistics; arms_read says which arms of recordings are their actions (worldmodel/trained_for.h).
TensorMetadata WhatFor(const TensorMetadata& shards);

/// Of a forecast: the same, and the plane that it looks for the thing on ("carry_plane_m"; empty: none).
TensorMetadata WhatForecastIsFor(const TensorMetadata& shards, const nn::ModelConfig& config);

/// A forecast counts turns in frames, knows views by their order, and looks where hands are: it is of no use to a network
/// that sees otherwise. What either does not say is not compared.
/// @param what_for  of the network, as WhatFor says it
/// @throws TensorError naming the file and what differs: period, cameras, arms (and which are read), how maps are drawn, or
///   the plane
void CheckForecastFor(const std::filesystem::path& forecast, const TensorMetadata& what_for);

/// All that TrainWorld looks at before it reads weights and builds the network: for a training that is carried elsewhere
/// (training_job.h), and would be refused there.
/// @throws TensorError for options that make no training, a start that does not fit (CheckStart), a forecast of others
///   (CheckForecastFor), and shards that do not fit one another or the page, that have no clip long enough, or no latents
///   of the start's codec
void CheckWorldTraining(const JobPlace& place, const WorldOptions& options, const WorldStart& start);

/// Trains the denoiser and its resamplers (EVAC's first stage of training is the codec) and writes
/// OUT/weights.safetensors: the whole network, the codec included, averaged weights of the best hold-out.
/// @param look  is given strips of the hold-out after each measurement
TrainerSummary TrainWorld(const JobPlace& place, const WorldOptions& options, const WorldStart& start,
                          const std::function<void(std::int64_t step, const Strips&)>& look);

}  // namespace evac::train
