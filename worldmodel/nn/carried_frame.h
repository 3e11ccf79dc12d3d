#pragma once

#include "worldmodel/nn/evac_model.h"

/// What a camera that moves sees of things that do not: not in the paper.
namespace evac::nn {

/// Where a frame's content is looked for when its camera has moved.
struct CarriedFrame {
  Tensor frames;  ///< [BV, c, K, H, W]: the frame as each later camera would see it
  Tensor seen;    ///< [BV, 1, K, h, w]: 1 where the frame shows the place, 0 where its nearest edge is repeated
};

/// Carries a frame to later cameras as if all it shows lay in the plane z = `plane_m` of the base frame (a table's
/// top): where a later place's ray meets the plane, the frame is read, between four of its positions. Rays that do not
/// meet the plane carry the frame as if it were infinitely far. A camera that stands still is given the frame itself.
/// @param frame      [BV, c, H, W]: as fine as the rays, or a whole number of times as fine
/// @param direction  [BV, 3, T, h, w] unit rays of pinhole cameras, base frame; h and w at least 2
/// @param origin     [BV, 3, T, h, w] metres, base frame, the same for all pixels of a row and frame
/// @param at         index in T of `frame`'s rays
/// @param first      index in T of the first later frame; the others follow to the end
CarriedFrame CarryAlongPlane(const Tensor& frame, const Tensor& direction, const Tensor& origin, std::int64_t at,
                             std::int64_t first, double plane_m);

/// The same for latents [BV, z, h, w], by way of their picture: a latent is a square of pixels, and what moved by half
/// of one is another latent, not the mean of two. Decoded, carried, encoded; what stands still stays what it is.
CarriedFrame CarryLatentsAlongPlane(const EvacModel& model, const Tensor& latents, const Tensor& direction,
                                    const Tensor& origin, std::int64_t at, std::int64_t first, double plane_m);

}  // namespace evac::nn
