#include "worldmodel/nn/carried_frame.h"

#include <ATen/ops/grid_sampler_2d.h>
#include <ATen/ops/linalg_inv.h>
#include <ATen/ops/where.h>

namespace evac::nn {
namespace {

/// The numbers that take a place, seen from the camera, to its position in the frame: times [BV, 3, points], then
/// divided by the third, x and y in positions from 0 to w - 1 and h - 1. From the rays of the four corners alone: a
/// pinhole's rays, as long as they are on one plane before it, form a parallelogram.
/// @param direction  [BV, 3, h, w]
Tensor FrameFromPlace(const Tensor& direction) {
  const std::int64_t h = direction.size(2), w = direction.size(3);
  const Tensor rays = direction.to(at::kDouble);
  const auto corner = [&](std::int64_t y, std::int64_t x) { return rays.select(2, y).select(2, x).unsqueeze(2); };
  const Tensor first = corner(0, 0), right = corner(0, w - 1), below = corner(h - 1, 0), last = corner(h - 1, w - 1);
  const Tensor lengths = at::matmul(at::linalg_inv(at::cat({right, below, -last}, 2)), first);  // [BV, 3, 1]
  const Tensor across = right * lengths.narrow(1, 0, 1) - first, down = below * lengths.narrow(1, 1, 1) - first;
  return at::linalg_inv(at::cat({across / static_cast<double>(w - 1), down / static_cast<double>(h - 1), first}, 2));
}

}  // namespace

CarriedFrame CarryAlongPlane(const Tensor& frame, const Tensor& direction, const Tensor& origin, std::int64_t at,
                             std::int64_t first, double plane_m) {
  const std::int64_t rows = frame.size(0), h = frame.size(2), w = frame.size(3), later = direction.size(2) - first;
  const Tensor ray = direction.narrow(2, first, later).flatten(2).to(at::kDouble);  // [BV, 3, K h w]
  const Tensor from = origin.narrow(2, first, later).flatten(2).to(at::kDouble);
  const Tensor distance = (plane_m - from.narrow(1, 2, 1)) / ray.narrow(1, 2, 1);
  const Tensor camera = origin.select(2, at).narrow(2, 0, 1).narrow(3, 0, 1).flatten(2).to(at::kDouble);
  constexpr double kFar_m = 1e4;  // and a ray along the plane, which meets it nowhere
  const Tensor place = at::where((distance > 0).logical_and(distance < kFar_m), from + distance * ray - camera, ray);
  const Tensor found = at::matmul(FrameFromPlace(direction.select(2, at)), place);
  const Tensor depth = found.narrow(1, 2, 1), safe = depth.clamp_min(1e-9);
  const Tensor x = found.narrow(1, 0, 1) / safe, y = found.narrow(1, 1, 1) / safe;
  const auto within = [](const Tensor& position, std::int64_t side) {
    return (position >= -0.5).logical_and(position <= static_cast<double>(side) - 0.5);
  };
  const Tensor seen = (depth > 1e-9).logical_and(within(x, w)).logical_and(within(y, h));
  const auto scaled = [](const Tensor& position, std::int64_t side) {
    return (position * (2.0 / static_cast<double>(side - 1)) - 1).clamp(-2, 2);
  };
  const Tensor grid = at::cat({scaled(x, w), scaled(y, h)}, 1).transpose(1, 2).reshape({rows, later * h, w, 2});
  constexpr std::int64_t kBilinear = 0, kRepeatEdge = 1;
  const Tensor read = at::grid_sampler_2d(frame, grid.to(frame.scalar_type()), kBilinear, kRepeatEdge, true);
  return {read.unflatten(2, {later, h}), seen.to(frame.scalar_type()).reshape({rows, 1, later, h, w})};
}

}  // namespace evac::nn
