#pragma once

#include <Eigen/Core>

namespace evac {

/// What makes one checkpoint of `visual_pick` better or worse than another; the defaults are the best it can do.
struct VisualPickOptions {
  int chunk_size = 8;  ///< targets per chunk, [1, 1000]
  Eigen::Vector2d bias_m =
      Eigen::Vector2d::Zero();   ///< it takes the thing to be this far off, base frame, [-0.5, 0.5] each
  double noise_m = 0;            ///< the same, drawn once per episode: standard deviation along x and y, [0, 0.5]
  double request_noise_m = 0;    ///< the same, drawn anew each time it looks
  double place_noise_m = 0;      ///< it takes the place to put it to be this far off: once per episode, [0, 0.5]
  double high_m = 0;             ///< it takes hold this much higher than it should, [-0.03, 0.06]
  double turn_deg = 0;           ///< it takes hold turned by this about the vertical, [-90, 90]
  double hurry = 0;              ///< how much of its pauses at the thing and at the place it skips, [0, 1]
  double late_close_s = 0;       ///< the hand closes this much after it should (before: below 0), [-0.5, 3]; the arm does not wait for it
  double early_release_s = 0;    ///< the hand opens this much before it should, [0, 3]
  double blindness = 0;          ///< probability that it sees nothing all episode and goes where the thing usually is
  double request_blindness = 0;  ///< the same for the pictures of one request
  double speed = 1;              ///< of all motion, [0.1, 1.5]; at 1 no faster than SpeedLimits' defaults
  int retries = 1;               ///< how often it goes back when its hand came up empty, [0, 5]
};

/// @throws InvalidInput naming the option, what was found and what was wanted.
void Check(const VisualPickOptions& options);

}  // namespace evac
