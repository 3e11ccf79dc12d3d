#include "worldmodel/nn/hand_views.h"

#include <ATen/ops/grid_sampler_2d.h>
#include <ATen/ops/where.h>

#include "worldmodel/nn/carried_frame.h"
#include "worldmodel/nn/frame_actions.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kArms = kHands, kArmNumbers = kHandNumbers, kKinds = kTurnKinds, kNumbers = kTurnNumbers;

/// [kHandPoints, 3] metres, hand's axes.
Tensor PointsOfAHand() {
  struct Grid {
    int half;
    float step_m;
  };
  std::vector<float> points_m;
  for (const Grid grid : {Grid{3, 0.012F}, Grid{2, 0.04F}}) {
    for (const std::size_t across : {0, 1, 2}) {  // the axis that this plane does not have
      for (int i = -grid.half; i <= grid.half; ++i) {
        for (int j = -grid.half; j <= grid.half; ++j) {
          float point_m[3] = {};
          point_m[(across + 1) % 3] = static_cast<float>(i) * grid.step_m;
          point_m[(across + 2) % 3] = static_cast<float>(j) * grid.step_m;
          points_m.insert(points_m.end(), std::begin(point_m), std::end(point_m));
        }
      }
    }
  }
  return at::tensor(points_m).reshape({kHandPoints, 3});
}

/// [B, T, arms, kHandPoints, 3] metres, base frame.
Tensor PointsAboutHands(const Tensor& arms, double tool_length_m) {
  const Tensor rows = arms.to(at::kFloat).unflatten(2, {kArms, kArmNumbers});
  return Fingertips(rows, tool_length_m).unsqueeze(3) + at::matmul(PointsOfAHand().to(arms.device()), HandRotation(rows));
}

}  // namespace

Tensor Fingertips(const Tensor& hands, double tool_length_m) {
  const Tensor pose_m = hands.narrow(-1, 0, 3);
  return tool_length_m == 0 ? pose_m : pose_m + HandRotation(hands).select(-2, 2) * tool_length_m;
}

Tensor HandViews(const Tensor& image, const Tensor& direction, const Tensor& origin, const Tensor& arms,
                 double tool_length_m) {
  CheckShape("arms of the frames", arms, {-1, -1, kArms * kArmNumbers});
  const std::int64_t scenes = arms.size(0), frames = arms.size(1), views = image.size(0) / scenes,
                     h = direction.size(3), w = direction.size(4);
  CheckShape("the picture about the hands", image, {scenes * views, 3, -1, -1});
  const Tensor points = PointsAboutHands(arms, tool_length_m).flatten(1, 3).repeat_interleave(views, 0);  // [BV, T arms P, 3]
  const Tensor found = SeenAt(points, direction.narrow(2, 0, 1), origin.narrow(2, 0, 1)).select(1, 0);
  const auto scaled = [&](std::int64_t axis, std::int64_t side) {  // -1 and 1: the outer edges of the picture
    constexpr double kOutside = 4;
    const Tensor position = (found.select(2, axis) + 0.5) * (2.0 / static_cast<double>(side)) - 1;
    return at::where(found.select(2, 2) > 1e-6, position.clamp(-kOutside, kOutside), at::full_like(position, kOutside));
  };
  const Tensor grid = at::stack({scaled(0, w), scaled(1, h)}, 2).unflatten(1, {frames * kArms, kHandPoints});
  const Tensor picture = at::cat({image.to(at::kFloat), at::ones_like(image.narrow(1, 0, 1)).to(at::kFloat)}, 1);
  constexpr std::int64_t kBilinear = 0, kZeros = 0;
  const Tensor read = at::grid_sampler_2d(picture, grid.to(at::kFloat), kBilinear, kZeros, false);  // [BV, 4, T arms, P]
  return read.reshape({scenes, views, kHandPointNumbers, frames, kArms, kHandPoints})
      .permute({0, 3, 4, 1, 5, 2})
      .flatten(3);
}

Tensor TurnViews(const Tensor& image, const Tensor& direction, const Tensor& origin, const Tensor& arms,
                 const Tensor& turns, double tool_length_m) {
  CheckShape("turns of the hands", turns, {arms.size(0), arms.size(1), static_cast<std::int64_t>(kTurnRow)});
  const Tensor each = turns.to(at::kFloat).unflatten(2, {kArms, kKinds, kNumbers});  // [B, T, arms, kinds, …]
  const Tensor was = each.narrow(4, 0, 1), then = each.narrow(4, 2, kArmNumbers),
               before = each.narrow(4, 2 + kArmNumbers, kArmNumbers);
  const Tensor as_frames = then.permute({0, 1, 3, 2, 4}).flatten(3).flatten(1, 2);  // [B, T kinds, 16]
  const Tensor views = HandViews(image, direction, origin, as_frames, tool_length_m)
                           .unflatten(1, {arms.size(1), kKinds})
                           .transpose(2, 3);  // [B, T, arms, kinds, any]
  const Tensor now = arms.to(at::kFloat).unflatten(2, {kArms, 1, kArmNumbers}).expand_as(then);
  const auto place = [](const Tensor& hand) { return hand.narrow(4, 0, 3); };
  constexpr double kFewFrames = 4, kManyFrames = 16, kPer_m = 10, kMovesPer_m = 30;
  const Tensor since = each.narrow(4, 1, 1), moved_m = place(now) - place(then), axes_then = HandRotation(then);
  const Tensor turned = at::matmul(axes_then, HandRotation(now).transpose(4, 5)).narrow(5, 0, 2).flatten(4);
  const Tensor numbers = at::cat({at::ones_like(was), since / kManyFrames, (since / -kFewFrames).exp(),
                                  at::matmul(axes_then, moved_m.unsqueeze(5)).squeeze(5) * kPer_m, moved_m * kPer_m,
                                  turned, (place(then) - place(before)) * kMovesPer_m},
                                 4);
  return at::cat({views, numbers}, 4) * was;
}

}  // namespace evac::nn
