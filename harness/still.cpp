#include "harness/still.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/geometry.h"

namespace evac {
namespace {

std::string Sentence(const Motion& motion) {
  return fmt::format("{:.1f} mm, {:.3f} rad, closure {:.3f}", 1e3 * motion.translation_m, motion.rotation_rad, motion.closure);
}

}  // namespace

Motion LargestMotion(const Arms& start, std::span<const Arms> later) {
  Motion motion;
  for (const Arms& arms : later) {
    for (std::size_t i = 0; i < std::min(arms.size(), start.size()); ++i) {
      const Eigen::Isometry3d &from = start[i].base_from_gripper, &to = arms[i].base_from_gripper;
      motion.translation_m = std::max(motion.translation_m, (to.translation() - from.translation()).norm());
      motion.rotation_rad = std::max(motion.rotation_rad, RotationBetween(from, to));
      motion.closure = std::max(motion.closure, std::abs(arms[i].closure - start[i].closure));
    }
  }
  return motion;
}

bool StillMeter::Below(const Motion& motion) const {
  return motion.translation_m < rule_.translation_m && motion.rotation_rad < rule_.rotation_rad && motion.closure < rule_.closure;
}

std::optional<std::string> StillMeter::Rest(const Arms& last, std::span<const Arms> chunk, std::span<const Arms> observed) {
  if (!rule_.enabled) return std::nullopt;
  const Motion commanded = LargestMotion(last, chunk);
  const Motion seen = observed.empty() ? Motion{} : LargestMotion(observed.front(), observed.subspan(1));
  still_ = Below(commanded) && Below(seen) ? still_ + 1 : 0;
  const bool rests = still_ >= rule_.dwell_chunks && chunks_ >= rule_.min_chunks;
  ++chunks_;
  if (!rests) return std::nullopt;
  return fmt::format("still for {} chunks: the commanded gripper moves at most {}, the observed one {} (limits {}), after {} chunks", still_,
                     Sentence(commanded), observed.empty() ? "is not measured" : "moved " + Sentence(seen),
                     Sentence({rule_.translation_m, rule_.rotation_rad, rule_.closure}), chunks_ - 1);
}

}  // namespace evac
