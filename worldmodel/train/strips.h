#pragma once

#include <cstdint>
#include <vector>

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/train/world_batch.h"

namespace evac::train {

/// Windows imagined and set beside the truth.
struct Strips {
  Tensor picture;  ///< [rows, columns, 3] bytes, RGB: per window a row of truth, and one imagined below it
  /// One number per view, in dB, colours 0 … 1: of the imagined frames, and of the newest memory frame repeated; of
  /// that frame carried along, if the model's schedule does so.
  std::vector<double> psnr, psnr_copy, psnr_carried;
};

struct StripOptions {
  std::int64_t steps = 6;  ///< of DPM-Solver++(2M)
  std::int64_t every = 5;  ///< the first frame and then every so-manieth is drawn; all are measured
  std::uint64_t seed = 0;
  at::Device device = at::kCPU;  ///< where the model's weights are
};

/// @param windows  of the shards, one clip's at a time; at least one
Strips DrawStrips(const nn::EvacModel& model, const ShardSet& shards, const std::vector<Window>& windows,
                  const StripOptions& options);

}  // namespace evac::train
