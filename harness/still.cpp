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

Motion Larger(const Motion& a, const Motion& b) {
  return {std::max(a.translation_m, b.translation_m), std::max(a.rotation_rad, b.rotation_rad), std::max(a.closure, b.closure)};
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
  const int executed = chunks_++;
  if (!rule_.enabled) return std::nullopt;
  const Motion commanded = LargestMotion(last, chunk);
  const Motion seen = observed.empty() ? Motion{} : LargestMotion(observed.front(), observed.subspan(1));
  still_ = Below(commanded) && Below(seen) ? still_ + 1 : 0;
  commanded_ = still_ > 1 ? Larger(commanded_, commanded) : commanded;
  seen_ = still_ > 1 ? Larger(seen_, seen) : seen;
  const bool rests = still_ >= rule_.dwell_chunks && executed >= rule_.min_chunks;
  if (!rests) return std::nullopt;
  return fmt::format("still for {} chunks: the commanded gripper moves at most {}, the observed one {} (limits {}), after {} chunks", still_,
                     Sentence(commanded_), observed.empty() ? "is not measured" : "moved " + Sentence(seen_),
                     Sentence({rule_.translation_m, rule_.rotation_rad, rule_.closure}), executed);
}

std::string StillMeter::AtLimit() const {
  if (!rule_.enabled) return fmt::format("after {} chunks, the task's limit; no rule says when it rests", chunks_);
  if (still_ == 0) return fmt::format("still moving after {} chunks, the task's limit", chunks_);
  return fmt::format("after {} chunks, the task's limit, still for the last {} (dwell_chunks {}, min_chunks {})", chunks_, still_,
                     rule_.dwell_chunks, rule_.min_chunks);
}

}  // namespace evac
