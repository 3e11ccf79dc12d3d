#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "worldmodel/action_statistics.h"

namespace evac {

/// Sums over many recordings from which a robot's ActionStatistics come. Adding recordings in the same order gives the
/// same bits.
class MotionSums {
 public:
  void Add(const std::vector<Arms>& track);

  /// Mean and deviation per frame of 30 Hz, as the network's deltas are normalised (action_delta.h): a step's mean and
  /// deviation, divided by `delta_frames`. An arm that never moves has mean 0 and deviation 1; no deviation is below
  /// 10 micrometres or .0001 rad a frame.
  /// @param delta_frames  frames of 30 Hz that one step spans
  ActionStatistics Statistics(const std::string& robot, double delta_frames) const;

 private:
  double steps_ = 0;
  std::array<double, 12> sum_{}, squares_{};
};

/// How late arms are where they were told to be: sums over many recordings.
struct LagSums {
  double behind_m2 = 0;  ///< of how far the arms are behind what they are told, along the step they are told
  double step_m2 = 0;    ///< of the steps themselves, squared

  /// @param told, measured  [T] of one recording, the same arms
  void Add(const std::vector<Arms>& told, const std::vector<Arms>& measured);
  void Add(const LagSums& other);
  /// Least squares over the grippers' places: shares of a frame. Nothing if nothing moved.
  std::optional<double> Frames() const;
};

/// A page as ReadActionStatistics reads it; every number comes back to the last bit.
std::string StatisticsPage(const ActionStatistics& statistics);

}  // namespace evac
