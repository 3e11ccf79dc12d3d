#include "worldmodel/nn/carried_frame.h"

#include <ATen/ops/grid_sampler_2d.h>
#include <ATen/ops/linalg_inv.h>
#include <ATen/ops/max_pool2d.h>
#include <ATen/ops/where.h>

#include <cmath>

#include "worldmodel/nn/carry_kernel.h"
#include "worldmodel/nn/latent_pictures.h"
#include "worldmodel/nn/layers.h"

namespace evac::nn {
namespace {

constexpr double kStill = 1e-6;  // of a ray or a metre: a camera that has not moved

/// The ray through a position, x and y in places from 0 to w - 1 and h - 1: this times (x, y, 1), of any length. From
/// the rays of the four corners alone: a pinhole's rays, as long as they are on one plane before it, form a
/// parallelogram.
/// @param direction  [N, 3, h, w]
/// @returns          [N, 3, 3], double
Tensor RayFromPosition(const Tensor& direction) {
  const std::int64_t h = direction.size(2), w = direction.size(3);
  const Tensor rays = direction.to(at::kDouble);
  const auto corner = [&](std::int64_t y, std::int64_t x) { return rays.select(2, y).select(2, x).unsqueeze(2); };
  const Tensor first = corner(0, 0), right = corner(0, w - 1), below = corner(h - 1, 0), last = corner(h - 1, w - 1);
  const Tensor lengths = at::matmul(at::linalg_inv(at::cat({right, below, -last}, 2)), first);  // [N, 3, 1]
  const Tensor across = right * lengths.narrow(1, 0, 1) - first, down = below * lengths.narrow(1, 1, 1) - first;
  return at::cat({across / static_cast<double>(w - 1), down / static_cast<double>(h - 1), first}, 2);
}

/// Middles of the pixels of a picture that is `finer` times as fine as the places of its rays, row by row, as
/// positions among the places. @returns [3, H W]: x, y, 1
Tensor PixelPositions(std::int64_t h, std::int64_t w, std::int64_t finer, const at::Device& device) {
  const auto along = [&](std::int64_t side) {
    return (at::arange(side * finer, at::kDouble) + 0.5) / static_cast<double>(finer) - 0.5;
  };
  const std::int64_t height = h * finer, width = w * finer;
  const Tensor x = along(w).reshape({1, width}).expand({height, width}),
               y = along(h).reshape({height, 1}).expand({height, width});
  return at::stack({x.flatten(), y.flatten(), at::ones({height * width}, at::kDouble)}).to(device);
}

/// Where in the frame `at` later frames' places are looked for: fields as in kernels::CarryGeometry, double.
struct Geometry {
  Tensor found_from_position;  ///< [BV, K, 3, 3]
  Tensor found_from_camera;    ///< [BV, K, 3, 1]
  Tensor rise_from_position;   ///< [BV, K, 1, 3]
  Tensor plane_above_camera;   ///< [BV, K, 1, 1] metres
};

Geometry GeometryOf(const Tensor& direction, const Tensor& origin, std::int64_t at, std::int64_t first,
                    double plane_m) {
  const std::int64_t rows = direction.size(0), later = direction.size(2) - first;
  const auto camera = [&](std::int64_t from, std::int64_t count) {
    const Tensor all = origin.narrow(2, from, count).narrow(3, 0, 1).narrow(4, 0, 1).to(at::kDouble);
    return all.transpose(1, 2).flatten(3);  // [BV, count, 3, 1]
  };
  const Tensor ray_from_position =
      RayFromPosition(direction.narrow(2, first, later).transpose(1, 2).flatten(0, 1)).unflatten(0, {rows, later});
  const Tensor position_from_ray = at::linalg_inv(RayFromPosition(direction.select(2, at))).unsqueeze(1);
  const Tensor from = camera(first, later);
  return {at::matmul(position_from_ray, ray_from_position), at::matmul(position_from_ray, from - camera(at, 1)),
          ray_from_position.narrow(2, 2, 1), plane_m - from.narrow(2, 2, 1)};
}

/// Positions among the places of a frame, and how far before its camera they lie.
struct Found {
  Tensor x, y, depth;  ///< [BV, K, H W], double
};

Found Find(const Geometry& geometry, std::int64_t h, std::int64_t w, std::int64_t finer) {
  const Tensor positions = PixelPositions(h, w, finer, geometry.rise_from_position.device());
  const Tensor distance = geometry.plane_above_camera / at::matmul(geometry.rise_from_position, positions);
  const Tensor far = at::matmul(geometry.found_from_position, positions);
  constexpr double kFar = 1e4;  // rays' lengths; and a ray along the plane, which meets it nowhere
  const Tensor found =
      at::where((distance > 0).logical_and(distance < kFar), geometry.found_from_camera + distance * far, far);
  const Tensor depth = found.select(2, 2), safe = depth.clamp_min(1e-9);
  return {found.select(2, 0) / safe, found.select(2, 1) / safe, depth};
}

/// In one pass over the pixels; what libtorch's operators do below in thirty.
CarriedFrame CarryByKernel(const Tensor& frame, const Geometry& geometry, std::int64_t h, std::int64_t w) {
  const std::int64_t rows = frame.size(0), later = geometry.rise_from_position.size(1), finer = frame.size(2) / h;
  const Tensor numbers = at::cat({geometry.found_from_position.flatten(2), geometry.found_from_camera.flatten(2),
                                  geometry.rise_from_position.flatten(2), geometry.plane_above_camera.flatten(2)},
                                 2)
                             .contiguous();
  static_assert(sizeof(kernels::CarryGeometry) == 16 * sizeof(double));
  const auto* each = reinterpret_cast<const kernels::CarryGeometry*>(numbers.data_ptr<double>());
  const auto bools = frame.options().dtype(at::kBool);
  const Tensor read = at::empty({rows, frame.size(1), later, frame.size(2), frame.size(3)}, frame.options()),
               seen = at::empty({rows, 1, later, h, w}, bools),
               shown = at::empty({rows, 1, later, frame.size(2), frame.size(3)}, bools);
  kernels::Carry({rows, later, frame.size(1), w, h, finer}, each, frame.data_ptr<float>(), read.data_ptr<float>(),
                 shown.data_ptr<bool>());
  kernels::Carry({rows, later, 0, w, h, 1}, each, nullptr, nullptr, seen.data_ptr<bool>());
  return {read, seen.to(frame.scalar_type()), shown};
}

/// [BV] true where none of `count` cameras from `first` on is elsewhere or looks elsewhere than `at`.
Tensor StandsStill(const Tensor& direction, const Tensor& origin, std::int64_t at, std::int64_t first,
                   std::int64_t count) {
  const auto moved = [&](const Tensor& of) {
    return (of.narrow(2, first, count) - of.narrow(2, at, 1)).abs().flatten(1).amax(1);
  };
  return (moved(direction) < kStill).logical_and(moved(origin) < kStill);
}

Tensor Indices(const Tensor& chosen) { return chosen.nonzero().squeeze(1); }

/// What an older frame shows, in these rows, where `of` shows nothing yet.
void FillIn(CarriedFrame& of, const CarriedFrame& older, const Tensor& rows) {
  const Tensor frames = of.frames.index_select(0, rows), shown = of.shown.index_select(0, rows),
               seen = of.seen.index_select(0, rows);
  of.frames.index_copy_(0, rows, at::where(older.shown.logical_and(shown.logical_not()), older.frames, frames));
  of.seen.index_copy_(0, rows, at::max(seen, kOlder * older.seen));
  of.shown.index_copy_(0, rows, shown.logical_or(older.shown));
}

/// Memory frames and where they and later ones are seen from: parameters of CarryLatentsAlongPlane.
struct Memories {
  const Tensor &latents, &direction, &origin;
  std::int64_t at, first;
  double plane_m;
};

/// What another view of the same scene saw change from memory frame `frame` to the newest, as later cameras of `rows`
/// would see it: nothing where the other camera itself moved meanwhile.
/// @param beside  as long as `rows`: the other view of each
/// @returns       [R, 1, K, h, w], of bools
Tensor ChangedBeside(const Memories& memories, std::int64_t frame, const Tensor& rows, const Tensor& beside,
                     double limit) {
  const std::int64_t last = memories.latents.size(2) - 1, newest = memories.at + last;
  const Tensor change = (memories.latents.select(2, last) - memories.latents.select(2, frame)).index_select(0, beside);
  const Tensor changed = (change.to(at::kFloat).square().mean(1, true).sqrt() > limit).to(at::kFloat);
  const Tensor and_around = at::max_pool2d(changed, {3, 3}, {1, 1}, {1, 1}).contiguous();
  const auto sequence = [&](const Tensor& of) {  // the other camera, then this one later
    const Tensor later = of.index_select(0, rows).narrow(2, memories.first, of.size(2) - memories.first);
    return at::cat({of.index_select(0, beside).narrow(2, newest, 1), later}, 2);
  };
  const CarriedFrame carried =
      CarryAlongPlane(and_around, sequence(memories.direction), sequence(memories.origin), 0, 1, memories.plane_m);
  const Tensor still = StandsStill(memories.direction, memories.origin, newest, memories.at + frame, last - frame);
  const Tensor counts = still.index_select(0, beside).reshape({-1, 1, 1, 1, 1});
  return (carried.frames > 0.5).logical_and(carried.seen > 0).logical_and(counts);
}

/// Less what any other view of its scene saw change meanwhile.
CarriedFrame WhereUnchanged(const CarriedFrame& older, const EvacModel& model, const Memories& memories,
                            std::int64_t frame, const Tensor& rows) {
  const std::int64_t views = model.config().views, finer = older.shown.size(3) / older.seen.size(3);
  if (memories.latents.size(0) % views != 0)
    throw TensorError("carry_unless_changed: found " + std::to_string(memories.latents.size(0)) +
                      " rows of latents, wanted a multiple of views = " + std::to_string(views));
  Tensor changed = at::zeros_like(older.seen, at::kBool);
  for (std::int64_t away = 1; away < views; ++away) {
    const Tensor view = rows.remainder(views), beside = rows - view + (view + away).remainder(views);
    changed.logical_or_(ChangedBeside(memories, frame, rows, beside, model.schedule().carry_unless_changed()));
  }
  const Tensor stayed = changed.logical_not();
  return {older.frames, older.seen * stayed.to(older.seen.scalar_type()),
          older.shown.logical_and(stayed.repeat_interleave(finer, 3).repeat_interleave(finer, 4))};
}

}  // namespace

CarriedFrame CarryAlongPlane(const Tensor& frame, const Tensor& direction, const Tensor& origin, std::int64_t at,
                             std::int64_t first, double plane_m) {
  const std::int64_t rows = frame.size(0), h = direction.size(3), w = direction.size(4),
                     later = direction.size(2) - first, height = frame.size(2), width = frame.size(3),
                     finer = height / h;
  CheckShape("a frame to carry", frame, {direction.size(0), -1, h * finer, w * finer});
  const Geometry geometry = GeometryOf(direction, origin, at, first, plane_m);
  if (CanUseKernels(frame)) return CarryByKernel(frame, geometry, h, w);
  const auto within = [](const Tensor& position, std::int64_t side) {
    return (position >= -0.5).logical_and(position <= static_cast<double>(side) - 0.5);
  };
  const auto is_shown = [&](const Found& at) {
    return (at.depth > 1e-9).logical_and(within(at.x, w)).logical_and(within(at.y, h)).unsqueeze(1);
  };
  const Found places = Find(geometry, h, w, 1), pixels = finer == 1 ? places : Find(geometry, h, w, finer);
  const auto scaled = [](const Tensor& position, std::int64_t side) {  // -1 and 1: the outer edges of the frame
    return ((position + 0.5) * (2.0 / static_cast<double>(side)) - 1).clamp(-2, 2);
  };
  const Tensor grid = at::stack({scaled(pixels.x, w), scaled(pixels.y, h)}, 3)  // [BV, K, H W, 2]
                          .reshape({rows, later * height, width, 2});
  constexpr std::int64_t kBilinear = 0, kRepeatEdge = 1;
  const Tensor read = at::grid_sampler_2d(frame.to(at::kFloat), grid.to(at::kFloat), kBilinear, kRepeatEdge, false);
  return {read.to(frame.scalar_type()).unflatten(2, {later, height}),
          is_shown(places).to(frame.scalar_type()).unflatten(3, {h, w}),
          is_shown(pixels).unflatten(3, {height, width})};
}

CarriedFrame CarryLatentsAlongPlane(const EvacModel& model, const Tensor& latents, const Tensor& direction,
                                    const Tensor& origin, std::int64_t at, std::int64_t first, double plane_m,
                                    const Tensor& noiseless) {
  const std::int64_t rows = latents.size(0), frames = latents.size(2), h = latents.size(3), w = latents.size(4),
                     later = direction.size(2) - first, newest = at + frames - 1;
  const Tensor last = latents.select(2, frames - 1);
  CarriedFrame carried{last.unsqueeze(2).expand({-1, -1, later, -1, -1}).clone(),
                       at::ones({rows, 1, later, h, w}, latents.options()),
                       {}};
  const Tensor moving = Indices(StandsStill(direction, origin, newest, first, later).logical_not());
  if (moving.numel() == 0) return carried;
  const Tensor moving_direction = direction.index_select(0, moving), moving_origin = origin.index_select(0, moving);
  const auto carry = [&](std::int64_t frame, const Tensor& of) {  // indices among those that move
    const Tensor picture =
        DecodeLatents(model, latents.select(2, frame).index_select(0, moving.index_select(0, of))).clamp(-1, 1);
    return CarryAlongPlane(picture, moving_direction.index_select(0, of), moving_origin.index_select(0, of), at + frame,
                           first, plane_m);
  };
  const Memories memories{noiseless.defined() ? noiseless : latents, direction, origin, at, first, plane_m};
  const bool goes_by_change = model.schedule().carry_unless_changed() > 0;
  CarriedFrame pictures = carry(frames - 1, at::arange(moving.numel(), moving.options()));
  for (std::int64_t frame = frames - 2; frame >= 0; --frame) {
    const Tensor elsewhere = StandsStill(moving_direction, moving_origin, at + frame, at + frame + 1, 1).logical_not();
    const Tensor adds = Indices(elsewhere.logical_and(pictures.shown.flatten(1).all(1).logical_not()));
    if (adds.numel() == 0) continue;
    CarriedFrame older = carry(frame, adds);
    if (goes_by_change) older = WhereUnchanged(older, model, memories, frame, moving.index_select(0, adds));
    FillIn(pictures, older, adds);
  }
  const Tensor encoded = EncodeImages(model, pictures.frames.transpose(1, 2).flatten(0, 1), Tensor());
  carried.frames.index_copy_(0, moving,
                             encoded.unflatten(0, {moving.numel(), later}).transpose(1, 2).to(latents.scalar_type()));
  carried.seen.index_copy_(0, moving, pictures.seen.to(latents.scalar_type()));
  return carried;
}

Tensor SeenAt(const Tensor& points_m, const Tensor& direction, const Tensor& origin) {
  const std::int64_t rows = direction.size(0), frames = direction.size(2);
  const Tensor position_from_ray = at::linalg_inv(RayFromPosition(direction.transpose(1, 2).flatten(0, 1)))
                                       .unflatten(0, {rows, frames});                      // [BV, T, 3, 3]
  const Tensor camera = origin.select(4, 0).select(3, 0).to(at::kDouble).transpose(1, 2);  // [BV, T, 3]
  const Tensor rays = points_m.to(at::kDouble).unsqueeze(1) - camera.unsqueeze(2);         // [BV, T, P, 3]
  const Tensor found = at::matmul(rays, position_from_ray.transpose(2, 3));
  const Tensor depth = found.narrow(3, 2, 1);
  return at::cat({found.narrow(3, 0, 2) / depth, depth}, 3);
}

Tensor RaysThrough(const Tensor& places, const Tensor& direction, std::int64_t at) {
  const Tensor x_y = places.to(at::kDouble), position = at::cat({x_y, at::ones_like(x_y.narrow(1, 0, 1))}, 1);
  return at::matmul(RayFromPosition(direction.select(2, at)), position.unsqueeze(2)).squeeze(2);
}

Tensor PointOnPlane(const Tensor& places, const Tensor& direction, const Tensor& origin, std::int64_t at,
                    double plane_m) {
  const Tensor ray = RaysThrough(places, direction, at);
  const Tensor camera = origin.select(2, at).select(3, 0).select(2, 0).to(at::kDouble);  // [BV, 3]
  const Tensor distance = (plane_m - camera.narrow(1, 2, 1)) / ray.narrow(1, 2, 1);
  return at::where(distance > 0, camera + distance * ray, at::full({1, 1}, std::nan(""), ray.options()));
}

}  // namespace evac::nn
