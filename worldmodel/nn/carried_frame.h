#pragma once

#include "worldmodel/nn/evac_model.h"

/// What a camera that moves sees of things that do not: not in the paper.
namespace evac::nn {

/// Where a frame's content is looked for when its camera has moved.
struct CarriedFrame {
  Tensor frames;  ///< [BV, c, K, H, W]: the frame as each later camera would see it
  Tensor seen;    ///< [BV, 1, K, h, w]: 1 where the frame shows the place, 0 where its nearest edge is repeated
  Tensor shown;   ///< [BV, 1, K, H, W], of bools: the same of each pixel
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

/// The same for latents, by way of their pictures: a latent is a square of pixels, and what moved by half of one is
/// another latent, not the mean of two. Decoded, carried, encoded; what a camera that stands still shows stays what it
/// is. Of several frames, the newest last, each pixel is of the newest that shows it; where only older ones show a
/// place, `seen` is kOlder; with the schedule's `carry_unless_changed`, no older frame shows a place where another view of
/// the same scene saw a change since. `shown` is not defined.
/// @param latents    [BV, z, M, h, w]
/// @param at         index in T of the rays of the first of them; the others follow
/// @param noiseless  likewise: what changes are looked for in, if noise was added to `latents`; undefined: `latents`
CarriedFrame CarryLatentsAlongPlane(const EvacModel& model, const Tensor& latents, const Tensor& direction,
                                    const Tensor& origin, std::int64_t at, std::int64_t first, double plane_m,
                                    const Tensor& noiseless = {});
inline constexpr double kOlder = 0.5;

/// Where points are seen.
/// @param points_m   [BV, P, 3] metres, base frame
/// @param direction  [BV, 3, T, h, w] and origin as above
/// @returns [BV, T, P, 3], double: x and y among the places (the first one's middle is 0), and how far before the
///   camera, in rays' lengths: not above 0 for what lies behind it
Tensor SeenAt(const Tensor& points_m, const Tensor& direction, const Tensor& origin);

/// The rays through places of frame `at`. @param places  [BV, 2]: x and y among them @returns [BV, 3], double, any length
Tensor RaysThrough(const Tensor& places, const Tensor& direction, std::int64_t at);

/// The point of the plane z = `plane_m` that is seen at a place of frame `at`.
/// @param places  [BV, 2]: x and y among the places
/// @returns [BV, 3], double, metres, base frame; not a number where the ray does not meet the plane
Tensor PointOnPlane(const Tensor& places, const Tensor& direction, const Tensor& origin, std::int64_t at,
                    double plane_m);

}  // namespace evac::nn
