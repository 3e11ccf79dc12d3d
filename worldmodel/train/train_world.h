#pragma once

#include "worldmodel/train/strips.h"
#include "worldmodel/train/train_codec.h"

namespace evac::train {

/// Where the first weights come from.
struct WorldStart {
  std::filesystem::path codec;  ///< of OUT/codec.safetensors, or a whole checkpoint whose codec is meant
  std::filesystem::path init = {};  ///< a checkpoint to go on from, every key of which must fit; empty: random
  /// Of `init`: keys that begin so are drawn anew ("model.diffusion_model.out." for another number of channels).
  std::vector<std::string> init_except = {};
  bool init_widen = false;  ///< `init` is of a model that was shown less (WidenedWeights)
  std::filesystem::path forecast = {};  ///< of OUT/forecast.safetensors; empty: `init` has one, or none is wanted
  std::string codec_sha256 = {};  ///< what the latents must have been made with; empty: not asked
};

/// Trains the denoiser and its resamplers (EVAC's first stage of training is the codec) and writes
/// OUT/weights.safetensors: the whole network, the codec included, averaged weights of the best hold-out.
/// @param look  is given strips of the hold-out after each measurement
TrainerSummary TrainWorld(const JobPlace& place, const WorldOptions& options, const WorldStart& start,
                          const std::function<void(std::int64_t step, const Strips&)>& look);

}  // namespace evac::train
