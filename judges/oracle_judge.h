#pragma once

#include <optional>
#include <string>

#include "core/judge.h"
#include "core/store.h"

namespace evac {

/// Judges an episode by what physics says: the privileged track against the task's rubric. The only reader of that
/// track.
///
/// Stages are reached in order. A stage is reached at the first frame, not before the one where the stage before it was
/// reached, from which on all its conditions hold for `hold_s` without a break; the frame where that time is full is
/// when it was reached. A stage `at_end` must besides hold at the last frame. Success: every stage was reached.
///
/// A condition measures body `a` (and `b`) at one frame and holds if the value is > `above` and < `below`, as far as
/// given:
///   distance             m, between the origins of a and b
///   horizontal_distance  m, the same without z
///   height               m, z of a's origin in the base frame (table top 0)
///   height_gain          m, height less that of the first frame
///   displacement         m, of a's origin since the first frame, without z
///   contact              N, sum of normal forces between a and b; 0 if they do not touch
///   tilt                 degrees in [0, 180] between the z axes of a and of the base
///   speed                m/s of a's origin since the frame before; 0 at the first
///
/// Verdicts: `success` or `failure` with a sentence that holds the numbers, `cannot_tell` where the world had no
/// physics or the task has no stages, `invalid` for a rubric that names a kind or a body that is not there.
class OracleJudge : public Judge {
 public:
  /// @param store  outlives this.
  explicit OracleJudge(const Store& store) : store_(store) {}

  std::string Name() const override { return "oracle"; }
  Verdict Rate(const Task& task, const Episode& episode) override;

 private:
  const Store& store_;
};

/// The same of a track that no store keeps: fills in label, stages, reason and the rubric's version.
/// @param track  [T], T >= 1
Verdict RateTrack(const Task& task, const PrivilegedTrack& track);

/// What is wrong with a rubric, as a sentence, or nothing: stages without a name or with one twice, without conditions,
/// an unknown kind, a body missing or too many, neither `above` nor `below`, bounds that exclude each other, a negative
/// hold_s.
std::optional<std::string> WhatIsWrong(const Rubric& rubric);
/// The same, and every body it names must be in `frame` (the first of any episode).
std::optional<std::string> WhatIsWrong(const Rubric& rubric, const PrivilegedFrame& frame);

}  // namespace evac
