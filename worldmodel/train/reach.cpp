#include "worldmodel/train/reach.h"

#include <ATen/ops/where.h>

#include <cmath>

#include "worldmodel/nn/carried_frame.h"

namespace evac::train {
namespace {

constexpr std::int64_t kArmNumbers = 8;  // xyz, quaternion xyzw, closure

/// Where the fingers of both arms meet, from the newest memory frame to the chunk's end: [B, P, 3] metres, base frame.
/// An arm that the robot lacks: not a number.
Tensor Fingertips(const WorldBatch& batch, double tool_length_m) {
  const std::int64_t newest = batch.memory - 1;
  std::vector<Tensor> points;
  for (const std::int64_t arm : {0, 1}) {
    const Tensor rows = batch.arms.narrow(1, newest, batch.arms.size(1) - newest).narrow(2, kArmNumbers * arm, 7);
    const auto number = [&](std::int64_t i) { return rows.select(2, i); };
    const Tensor x = number(3), y = number(4), z = number(5), w = number(6), xyz = rows.narrow(2, 0, 3);
    const Tensor along = at::stack({2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}, 2);
    const Tensor is_there = (xyz != 0).any(2, true);
    points.push_back(at::where(is_there, xyz + tool_length_m * along, at::full({1}, std::nanf(""), xyz.options())));
  }
  return at::cat(points, 1);
}

/// How near each latent pixel is to the nearest of the places.
/// @param places  [BV, K, P, 2]: x, y in latent pixels, the first one's middle at .5; not a number: nowhere
Tensor Near(const Tensor& places, std::int64_t h, std::int64_t w, double radius) {
  const auto apart = [&](std::int64_t side, std::int64_t which) {
    return (at::arange(side, places.options()) + 0.5 - places.select(3, which).unsqueeze(3)).square();  // [BV, K, P, side]
  };
  const Tensor distance = apart(w, 0).unsqueeze(3) + apart(h, 1).unsqueeze(4);  // [BV, K, P, h, w]
  return (distance * (-0.5 / (radius * radius))).exp().nan_to_num(0).amax(2).unsqueeze(1);
}

}  // namespace

Tensor WithinReach(const WorldBatch& batch, const nn::ModelConfig& config, double radius) {
  const std::int64_t first = batch.memory, newest = first - 1, chunk = batch.latents.size(2) - first,
                     h = batch.latents.size(3), w = batch.latents.size(4);
  const Tensor object = batch.object.select(2, newest);  // [BV, 2]
  Tensor points = Fingertips(batch, config.pose_map.tool_length_m).to(at::kDouble).repeat_interleave(batch.views, 0);
  const bool on_plane = config.schedule.carry_plane_m.has_value();
  if (on_plane) {
    const Tensor point =
        nn::PointOnPlane(object - 0.5, batch.direction, batch.origin, newest, *config.schedule.carry_plane_m);
    points = at::cat({points, point.unsqueeze(1)}, 1);
  }
  const auto later = [&](const Tensor& of) { return of.narrow(2, first, chunk); };
  const Tensor seen = nn::SeenAt(points, later(batch.direction), later(batch.origin));  // [BV, K, P, 3]
  const Tensor nowhere = at::full({1}, std::nan(""), seen.options());
  Tensor places = at::where(seen.narrow(3, 2, 1) > 0, seen.narrow(3, 0, 2) + 0.5, nowhere).to(at::kFloat);
  if (!on_plane) {
    const Tensor stays = object.reshape({-1, 1, 1, 2}).expand({-1, chunk, -1, -1});
    places = at::cat({places, stays.to(at::kFloat)}, 2);
  }
  return Near(places, h, w, radius);
}

}  // namespace evac::train
