#include "worldmodel/nn/frame_actions.h"

#include <ATen/ops/linalg_cross.h>

#include <numbers>

namespace evac::nn {
namespace {

constexpr std::int64_t kArmNumbers = 8;  // of a row
constexpr double kClosed = 120, kPositions_per_m = 4, kChanges_per_m = 10;
constexpr double kWaves_m[] = {0.25, 0.0625};

}  // namespace

Tensor HandAxes(const Tensor& quaternion) {
  const Tensor q = quaternion / quaternion.square().sum(-1, true).sqrt().clamp_min(1e-6);
  const Tensor x = q.select(-1, 0), y = q.select(-1, 1), z = q.select(-1, 2), w = q.select(-1, 3);
  return at::stack({1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),  //
                    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
                   -1);
}

Tensor HandRotation(const Tensor& hand) {
  const Tensor xy = HandAxes(hand.narrow(-1, 3, 4)), x = xy.narrow(-1, 0, 3), y = xy.narrow(-1, 3, 3);
  return at::stack({x, y, at::linalg_cross(x, y)}, -2);
}

Tensor FrameActions(const Tensor& rows, std::int64_t memory) {
  CheckShape("arms of the frames", rows, {-1, -1, 2 * kArmNumbers});
  std::vector<Tensor> numbers;
  for (std::int64_t arm = 0; arm < 2; ++arm) {
    const Tensor row = rows.narrow(-1, arm * kArmNumbers, kArmNumbers);
    const Tensor xyz_m = row.narrow(-1, 0, 3), closure = row.narrow(-1, 7, 1) / kClosed;
    const auto since = [&](const Tensor& x) { return x - x.narrow(1, memory - 1, 1); };
    numbers.insert(numbers.end(), {xyz_m * kPositions_per_m, HandAxes(row.narrow(-1, 3, 4)), closure * 2 - 1,
                                   since(xyz_m) * kChanges_per_m, since(closure)});
    for (const double wave_m : kWaves_m) {
      const Tensor angle = xyz_m * (2 * std::numbers::pi / wave_m);
      numbers.insert(numbers.end(), {angle.sin(), angle.cos()});
    }
  }
  return at::cat(numbers, -1);
}

Tensor HandPoses(const Tensor& frames) {
  constexpr std::int64_t kPose = 10, kCounted = 4;  // a hand's first numbers; those counted from the memory behind them
  const Tensor hands = frames.unflatten(2, {2, kFrameActionNumbers / 2});
  const std::int64_t waves = kPose + kCounted;
  return at::cat({hands.narrow(3, 0, kPose), hands.narrow(3, waves, hands.size(3) - waves)}, 3);
}

}  // namespace evac::nn
