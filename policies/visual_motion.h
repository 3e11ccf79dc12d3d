#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

namespace evac {

/// How fast a gripper may be told to move: peaks, not means.
struct SpeedLimits {
  double translation_mps = 0.38;
  double rotation_radps = 2.4;
};

/// A path of straight moves and pauses for one gripper, as a function of time. Each move starts and ends at rest:
/// minimum jerk in time (Flash and Hogan 1985), rotations by slerp.
class Timeline {
 public:
  /// Begins at `base_from_gripper`, at time 0.
  Timeline(const Eigen::Isometry3d& base_from_gripper, const SpeedLimits& limits);

  void MoveTo(const Eigen::Isometry3d& base_from_gripper);
  void Pause(double duration_s);

  /// Where the gripper is at `time_s`; the first pose before the beginning, the last after the end.
  Eigen::Isometry3d At(double time_s) const;
  /// Of everything appended so far: the time at which the next move would begin.
  double duration_s() const { return segments_.empty() ? 0 : segments_.back().end_s; }

 private:
  struct Segment {
    double begin_s, end_s;
    Eigen::Isometry3d from, to;
  };
  const Eigen::Isometry3d& Last() const { return segments_.empty() ? start_ : segments_.back().to; }

  Eigen::Isometry3d start_;
  SpeedLimits limits_;
  std::vector<Segment> segments_;
};

/// When the hand closes and opens again, on the clock of a Timeline.
struct HandSchedule {
  double start_closure = 0;       ///< [0, 1], where the hand is before anything happens
  std::optional<double> close_s;  ///< begins to close
  std::optional<double> open_s;   ///< begins to open; a hand told to open never closes again

  /// What the hand is told at `time_s`: it goes from open to closed in `kTravel_s`.
  double At(double time_s) const;
  static constexpr double kTravel_s = 0.3;
};

}  // namespace evac
