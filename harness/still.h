#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/types.h"

namespace evac {

/// The largest departure of one gripper from where it was, over a span of time.
struct Motion {
  double translation_m = 0;
  double rotation_rad = 0;  ///< [0, pi]
  double closure = 0;       ///< [0, 1]
};

/// How far `arms` ever is from `start`, per quantity, over all arms and times. Zero for an empty span.
Motion LargestMotion(const Arms& start, std::span<const Arms> later);

/// The paper's stop rule for one episode (EVAC, Sec. 3.4: a rollout ends when the motion falls below a threshold).
///
/// An episode has come to rest when both the newly commanded chunk and, where it was observed and not merely commanded, the
/// gripper during the chunk before stayed below every threshold, `dwell_chunks` times in a row, `min_chunks` executed.
/// Both matter: a stuck arm still commanded has not finished, a coasting arm no longer commanded has not either.
class StillMeter {
 public:
  explicit StillMeter(const StillRule& rule) : rule_(rule) {}

  /// Call once per chunk, before it is executed.
  /// @param last      where the arms are: the last target, or the first observation's arms before any.
  /// @param chunk     the targets about to be executed.
  /// @param observed  arms observed since the chunk before was commanded, the one at its start first; empty where only
  ///                  commanded arms are known.
  /// @returns the sentence with the numbers if the episode is over, else nothing.
  std::optional<std::string> Rest(const Arms& last, std::span<const Arms> chunk, std::span<const Arms> observed);

  /// What is to be said where the task's limit ends the episode after the chunks so far: it need not have moved.
  std::string AtLimit() const;

 private:
  bool Below(const Motion& motion) const;

  StillRule rule_;
  int chunks_ = 0;  ///< asked about so far
  int still_ = 0;   ///< in a row
  Motion commanded_, seen_;  ///< the largest in those
};

}  // namespace evac
