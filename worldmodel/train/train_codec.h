#pragma once

#include "worldmodel/train/settings.h"

namespace evac::train {

/// Where a training reads and writes, and who hears of it.
struct JobPlace {
  std::filesystem::path shards;  ///< a folder of `evac pack`
  std::filesystem::path out;     ///< see Trainer; and the weights when it ends
  nn::ModelConfig config;
  int threads = 1;  ///< parts of a step (`accumulate`) that are computed side by side, each on one core
  std::function<bool()> interrupted = {};
  std::function<void(const TrainerProgress&)> on_progress = {};
  std::function<void(const std::string& sentence)> say = {};
};

/// How many threads share the parts of a step; what the sums' last digits depend on.
std::int64_t Workers(const JobPlace& place, const JobOptions& options);

/// Trains the codec and writes OUT/codec.safetensors: its parameters alone, latents normalised, what they are worth in
/// the metadata (psnr, psnr_object, psnr_maps: dB, hold-out). An interrupted training writes none.
TrainerSummary TrainCodec(const JobPlace& place, const CodecOptions& options);

}  // namespace evac::train
