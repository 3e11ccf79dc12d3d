#pragma once

#include <functional>

#include "worldmodel/nn/ddim.h"
#include "worldmodel/nn/diffusion_loss.h"
#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/imagine_options.h"
#include "worldmodel/nn/latent_pictures.h"

/// One chunk of imagination: conditioning, then denoising. Tensors in, latents out; whose robot it is, is known
/// elsewhere.
namespace evac::nn {

/// What is known before a chunk, of B scenes with V views each.
struct ChunkRequest {
  Tensor memory;     ///< [BV, z, N, h, w] latents, newest last
  Tensor image;      ///< [BV, 3, H, W] in [-1, 1]: the oldest of the memory, for the image encoder
  Tensor pose_maps;  ///< [BV, z, K, h, w] latents of the maps of the frames to imagine: EncodePoseMaps
  Tensor direction;  ///< [BV, 3, T, h, w]
  Tensor origin;     ///< [BV, 3, T, h, w]
  Tensor deltas;     ///< [B, any, 14], normalised
  Tensor arms = {};  ///< [B, T, 16] rows as in frame_actions.h; read if the network has `frame_actions`, `hand_views` or
                       ///< `object_forecast`
  Tensor turns = {};  ///< [B, T, kTurnRow]: HandTurns; read if the network has `object_forecast`
};

/// Everything random, drawn by the caller.
struct ChunkNoise {
  Tensor start;    ///< [BV, z, K, h, w]
  DrawNoise step;  ///< [BV, z, T, h, w]
};

/// What the denoiser is told.
struct Conditioning {
  std::int64_t views = 1, memory = 0;  ///< V, N
  Concat concat;
  Tensor tokens;       ///< [BV, image tokens + action tokens, context_dim]
  Tensor frames = {};  ///< [B, T, kFrameActionNumbers] or undefined
  Tensor hands = {};   ///< HandViews or undefined
};

Conditioning Condition(const EvacModel& model, const ChunkRequest& request);
/// The same without the image: the other half of guidance. Actions, pose maps and rays stay.
Conditioning Unconditioned(const EvacModel& model, const ChunkRequest& request, const Conditioning& conditioning);

/// The network with its context worked out, as the samplers want it. `model` must outlive it.
Denoise MakeDenoise(const EvacModel& model, const Conditioning& conditioning);

/// @returns [BV, z, T, h, w]: the memory as given, then the imagined latents.
Tensor ImagineChunk(const EvacModel& model, const ChunkRequest& request, const ChunkNoise& noise,
                    const ImagineOptions& options);

}  // namespace evac::nn
