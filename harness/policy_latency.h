#pragma once

#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// What the world does while a policy thinks (docs/suite.md, `policy.latency`).
struct PolicyLatency {
  enum class Kind {
    kOff,      ///< it waits: thinking costs nothing
    kFixed,    ///< it moves on for `fixed_s`
    kMeasured  ///< it moves on for as long as the answer took (ActionChunk::thinking_s): no two runs are alike
  };
  Kind kind = Kind::kOff;
  double fixed_s = 0;

  /// Whole periods that pass before a chunk that took `thinking_s` can be executed.
  int Periods(double thinking_s, double period_s) const;
  /// "off", "0.3 s", "measured".
  std::string Text() const;
};

/// Which targets a lane executes, and when: a chunk's first ones, and while the next is thought about what is left of
/// it; when nothing is left, the arms hold. Of the new chunk, the targets that the old one has meanwhile executed in
/// their place are skipped; time spent holding skips nothing: the plan is late by that.
class ExecutedPlan {
 public:
  /// @param chunk_size  targets executed per chunk.
  ExecutedPlan(const PolicyLatency& latency, int chunk_size) : latency_(latency), chunk_size_(chunk_size) {}

  /// What is executed from the observation that `chunk` answers until the next one.
  /// @param last  the last target before, or where the arms were first observed.
  /// @returns the targets; `ends_recording` if the chunk's last one is among them.
  ActionChunk Execute(const Arms& last, const ActionChunk& chunk, double period_s);

 private:
  PolicyLatency latency_;
  int chunk_size_;
  std::vector<Arms> left_;  ///< of the last chunk, not executed
};

}  // namespace evac
