#pragma once

#include "worldmodel/train/train_codec.h"

namespace evac::train {

/// Trains the network that says where the thing will be and writes OUT/forecast.safetensors: its parameters alone, what
/// it is worth on the hold-out in the metadata (agreement, finder_px). Shards need no latents.
/// @throws TensorError for options that make no training, if the sizes have no `object_forecast`, or if no clip says
///   where its object is
TrainerSummary TrainForecast(const JobPlace& place, const ForecastOptions& options);

}  // namespace evac::train
