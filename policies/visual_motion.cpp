#include "policies/visual_motion.h"

#include <algorithm>
#include <cmath>

#include "core/geometry.h"

namespace evac {
namespace {

constexpr double kPeakOverMean = 1.875;  // of the speed along a minimum-jerk path

double MinimumJerk(double s) { return s * s * s * (10 + s * (6 * s - 15)); }

Eigen::Isometry3d Between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double share) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(from.linear()).slerp(share, Eigen::Quaterniond(to.linear())).toRotationMatrix();
  pose.translation() = (1 - share) * from.translation() + share * to.translation();
  return pose;
}

/// From `start` towards `goal`, `elapsed_s` after it began to travel.
double Travelled(double start, double goal, double elapsed_s) {
  const double step = std::max(0.0, elapsed_s) / HandSchedule::kTravel_s;
  return goal > start ? std::min(goal, start + step) : std::max(goal, start - step);
}

}  // namespace

Timeline::Timeline(const Eigen::Isometry3d& base_from_gripper, const SpeedLimits& limits)
    : start_(base_from_gripper), limits_(limits) {}

void Timeline::MoveTo(const Eigen::Isometry3d& base_from_gripper) {
  const double distance_m = (base_from_gripper.translation() - Last().translation()).norm();
  const double angle_rad = RotationBetween(base_from_gripper, Last());
  const double straight_s = std::max(distance_m / limits_.translation_mps, angle_rad / limits_.rotation_radps);
  segments_.push_back({duration_s(), duration_s() + kPeakOverMean * straight_s, Last(), base_from_gripper});
}

void Timeline::Pause(double duration_s) {
  const double begin_s = this->duration_s();
  segments_.push_back({begin_s, begin_s + duration_s, Last(), Last()});
}

Eigen::Isometry3d Timeline::At(double time_s) const {
  if (time_s <= 0) return start_;
  for (const Segment& segment : segments_) {
    if (time_s >= segment.end_s) continue;
    return Between(segment.from, segment.to,
                   MinimumJerk((time_s - segment.begin_s) / (segment.end_s - segment.begin_s)));
  }
  return Last();
}

double HandSchedule::At(double time_s) const {
  const auto closure_before = [this](double until_s) {
    return close_s ? Travelled(start_closure, 1, until_s - *close_s) : start_closure;
  };
  if (!open_s || time_s < *open_s) return closure_before(time_s);
  return Travelled(closure_before(*open_s), 0, time_s - *open_s);
}

}  // namespace evac
