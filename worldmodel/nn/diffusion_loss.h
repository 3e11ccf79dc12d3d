#pragma once

#include <optional>

#include "worldmodel/nn/evac_model.h"

/// The denoiser's training objective, the error of v (noise_schedule.h) in the chunk's frames, and how its input is put
/// together, both as the reference has them (docs/evac_quirks.md).
namespace evac::nn {

/// What stands beside the noisy latents.
struct Concat {
  Tensor image;      ///< [BV, z, T, h, w]: memory latents, the last of them repeated, times mask
  Tensor mask;       ///< [BV, 1, T, h, w]: 1 where `image` may be read
  Tensor pose_map;   ///< [BV, z, T, h, w]: 0 in memory frames
  Tensor direction;  ///< [BV, 3, T, h, w]: unit rays, base frame
  Tensor origin;     ///< [BV, 3, T, h, w]: metres, base frame
  /// [BV, z, T, h, w]: as `image`, but the last memory frame carried to where the camera is; undefined: it is not.
  Tensor carried = {};
  Tensor seen = {};  ///< [BV, 1, T, h, w]: 1 where that frame shows the place; undefined with `carried`
  Tensor first = {}, first_seen = {};  ///< the same of the oldest memory frame; undefined: it is not carried
  Tensor object = {};  ///< [BV, 1, T, h, w]: where the thing is likely to be; undefined: the network is not shown it
  /// [BV, z, K, h, w]: the chunk in which nothing changes, whatever the mask: the newest memory frame, repeated or
  /// carried.
  Tensor still = {};
};

/// Fills in `image`, `still`, and what is carried if the schedule says so, from the memory [BV, z, N, h, w] and the
/// rest; without gradients.
/// @param noiseless  likewise [BV, z, N, h, w]: the memory before noise was added to it, which is no change of the scene;
///                   undefined: none was
void Remember(const EvacModel& model, const Tensor& memory, Concat& concat, const Tensor& noiseless = {});

/// [BV, in_channels, T, h, w] in the order the network was trained with.
Tensor DenoiserInput(const Tensor& x, const Concat& concat);

/// What the network's answer is added to: nothing, or, with `from_last_frame`, the v of a chunk in which nothing
/// changes.
/// @param v  [BV, z, T, h, w]: the network's answer
/// @param t  [BV] integers
/// @returns  [BV, z, T, h, w]
Tensor FromLastFrame(const NoiseSchedule& schedule, const Tensor& v, const Concat& concat, const Tensor& t);

/// What a sampler answers, less what `unchanged_below` takes for no change.
/// @param imagined  [BV, z, K, h, w]: clean latents of the chunk
/// @param still     likewise: Concat::still
Tensor LeaveUnchanged(const NoiseSchedule& schedule, const Tensor& imagined, const Tensor& still);

/// Noise on the memory in training, so that the network bears with its own mistakes later.
struct TeacherForcing {
  Tensor angle;              ///< [BV, N] in [-1.57, 1.57]: below 0 no noise
  std::int64_t divisor = 3;  ///< 3 … 20
  Tensor noise;              ///< [BV N, z, h, w]
};

struct DiffusionBatch {
  Tensor latents;  ///< [BV, z, T, h, w], clean
  Concat concat;   ///< remembered here, if it is not or if the memory is noised here
  UNet::Context context;
  Tensor t;                 ///< [B] integers
  Tensor noise;             ///< [BV, z, T, h, w]
  std::int64_t memory = 0;  ///< N
  std::optional<TeacherForcing> teacher_forcing;
  Tensor weight = {};        ///< of the errors, to be broadcast to [BV, 1, K, h, w]; undefined: 1
  double squared_below = 0;  ///< as in ErrorsOfPlaces
};

/// How much each place errs: the mean e² of its channels' squared errors, or, with `squared_below` c > 0, 2 c (√(e² + c²) - c):
/// e² where e is far below c, 2 c e far above (pseudo-Huber, of a place's channels together). What makes the former least is
/// the mean of all that may come, a thing half there; what makes the latter least is near the likelier of two ends.
/// @param found   [BV, z, K, h, w]
/// @param wanted  likewise
/// @returns       [BV, 1, K, h, w], differentiable
Tensor ErrorsOfPlaces(const Tensor& found, const Tensor& wanted, double squared_below);

/// Mean error of v over the frames to imagine, weighted. @returns a number, differentiable.
Tensor DiffusionLoss(const EvacModel& model, const DiffusionBatch& batch);

}  // namespace evac::nn
