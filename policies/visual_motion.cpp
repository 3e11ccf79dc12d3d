#include "policies/visual_motion.h"

#include <algorithm>
#include <cmath>

#include "core/geometry.h"

namespace evac {
namespace {

constexpr double kPeakOverMean = 1.875;  // of the speed along a minimum-jerk path

double MinimumJerk(double s) { return s * s * s * (10 + s * (6 * s - 15)); }

double Fraction(double time_s, double duration_s) {
  return duration_s > 0 ? std::clamp(time_s / duration_s, 0.0, 1.0) : 1.0;
}

}  // namespace

Move::Move(const ArmState& from, const ArmState& to, const SpeedLimits& limits) : from_(from), to_(to) {
  const double distance_m = (to.base_from_gripper.translation() - from.base_from_gripper.translation()).norm();
  const double angle_rad = RotationBetween(from.base_from_gripper, to.base_from_gripper);
  closure_s_ = std::abs(to.closure - from.closure) / limits.closure_per_s;
  duration_s_ = std::max(kPeakOverMean * std::max(distance_m / limits.translation_mps, angle_rad / limits.rotation_radps),
                         closure_s_);
}

ArmState Move::At(double time_s) const {
  const double along = MinimumJerk(Fraction(time_s, duration_s_));
  const Eigen::Quaterniond from(from_.base_from_gripper.linear()), to(to_.base_from_gripper.linear());
  ArmState state;
  state.base_from_gripper.linear() = from.slerp(along, to).toRotationMatrix();
  state.base_from_gripper.translation() = (1 - along) * from_.base_from_gripper.translation() +
                                          along * to_.base_from_gripper.translation();
  state.closure = from_.closure + Fraction(time_s, closure_s_) * (to_.closure - from_.closure);
  return state;
}

}  // namespace evac
