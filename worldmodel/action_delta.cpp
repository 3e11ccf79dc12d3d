#include "worldmodel/action_delta.h"

#include <cmath>
#include <numbers>

#include "core/error.h"

namespace evac {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGimbalLock = 1e-7;  // radians from straight up or down

double Wrapped(double angle) {
  const double turn = 2 * kPi;
  const double positive = angle - turn * std::floor(angle / turn);
  return positive > kPi ? positive - turn : positive;
}

}  // namespace

BothGrippers GrippersOf(const Arms& arms) {
  if (arms.empty() || arms.size() > 2) throw InvalidInput("{} arms, wanted one or two", arms.size());
  const auto pose = [](const ArmState& arm) {
    return GripperPose{arm.base_from_gripper.translation(),
                       Eigen::Quaterniond(arm.base_from_gripper.linear()).normalized(), arm.closure};
  };
  BothGrippers both;
  if (arms.size() == 2) both[0] = pose(arms.front());
  both[1] = pose(arms.back());
  return both;
}

Eigen::Vector3d RollPitchYaw(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d r = rotation.normalized().toRotationMatrix();
  const double pitch = std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0)));
  if (kPi / 2 - std::abs(pitch) < kGimbalLock) return {std::atan2(-r(1, 2), r(1, 1)), pitch, 0};
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

ActionDelta DeltaBetween(const BothGrippers& before, const BothGrippers& after) {
  ActionDelta delta{};
  for (std::size_t arm = 0; arm < 2; ++arm) {
    const Eigen::Vector3d moved = after[arm].xyz_m - before[arm].xyz_m;
    const Eigen::Vector3d turned =
        RollPitchYaw(after[arm].base_from_gripper) - RollPitchYaw(before[arm].base_from_gripper);
    for (int i = 0; i < 3; ++i) {
      delta[7 * arm + static_cast<std::size_t>(i)] = moved[i];
      delta[7 * arm + 3 + static_cast<std::size_t>(i)] = Wrapped(turned[i]);
    }
    delta[7 * arm + 6] = after[arm].closure;
  }
  return delta;
}

std::array<float, 14> Normalised(const ActionDelta& delta, const ActionStatistics& statistics, double stride) {
  std::array<float, 14> normalised{};
  for (std::size_t i = 0; i < delta.size(); ++i) {
    const std::size_t arm = i / 7, column = i % 7;
    double value = delta[i];
    if (column < 6) {
      const std::size_t row = 6 * arm + column;
      value = (value - stride * statistics.mean[row]) / (stride * statistics.deviation[row]);
    }
    normalised[i] = static_cast<float>(value);
  }
  return normalised;
}

}  // namespace evac
