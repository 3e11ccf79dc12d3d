#pragma once

#include "core/types.h"

namespace evac {

/// How fast an arm may be told to move.
struct SpeedLimits {
  double translation_mps = 0.30;  ///< peak, not mean
  double rotation_radps = 1.5;
  double closure_per_s = 2.5;     ///< of the gripper: closed in 0.4 s
};

/// A straight move from one arm state to another that starts and ends at rest: minimum jerk in time (Flash and Hogan
/// 1985), the rotation by slerp, the gripper linear at its own speed.
class Move {
 public:
  Move(const ArmState& from, const ArmState& to, const SpeedLimits& limits);

  /// Where the arm is told to be `time_s` after the move's start; the end of it from `duration_s` on.
  ArmState At(double time_s) const;
  double duration_s() const { return duration_s_; }

 private:
  ArmState from_, to_;
  double duration_s_ = 0;
  double closure_s_ = 0;
};

}  // namespace evac
