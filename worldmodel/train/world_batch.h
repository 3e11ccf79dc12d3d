#pragma once

#include "worldmodel/nn/diffusion_loss.h"
#include "worldmodel/train/windows.h"

/// Windows of shards as the tensors that the world model is trained with.
namespace evac::train {

struct WorldBatch {
  std::int64_t scenes = 0, views = 1, memory = 0;  ///< B, V, N
  Tensor latents;    ///< [BV, z, T, h, w], clean, float
  Tensor pose_maps;  ///< [BV, z, T, h, w], 0 in memory frames
  Tensor direction;  ///< [BV, 3, T, h, w]: unit rays, base frame
  Tensor origin;     ///< [BV, 3, T, h, w], metres
  Tensor images;     ///< [BV, 3, H, W] in [-1, 1]: for the image encoder
  Tensor deltas;     ///< [B, K, 14]
  Tensor arms;       ///< [B, T, 16]: rows of nn::FrameActions
  Tensor turns;      ///< [B, T, nn::kTurnRow]: nn::HandTurns since the oldest memory
  Tensor object;     ///< [BV, 2, T]: x, y of the object in latent pixels; not a number where unknown

  /// The same numbers where the network is.
  WorldBatch To(at::Device device) const;
};

/// @param shards  with latents open
/// @returns on the CPU
WorldBatch MakeWorldBatch(const ShardSet& shards, const std::vector<Window>& windows);

/// Rays through the centres of latent pixels (EVAC, Sec. 3.2).
/// @param c2w  [N, 4, 4] base_from_camera
/// @param k    [N, 3, 3] pixels of the picture
/// @returns    direction [N, 3, h, w] of unit length and origin [N, 3, h, w], base frame
struct Rays {
  Tensor direction, origin;
};
Rays RaysOf(const Tensor& c2w, const Tensor& k, const std::vector<std::int64_t>& picture_px,
            const std::vector<std::int64_t>& latent_px);

}  // namespace evac::train
