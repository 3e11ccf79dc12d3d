#pragma once

#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// A kind of condition: docs of OracleJudge list them.
struct MeasureKind {
  const char* name;
  const char* unit;
  bool needs_b;  ///< whether it is about two bodies
};
/// @returns null if there is no such kind.
const MeasureKind* FindMeasure(const std::string& kind);

/// Frames of one episode, `period_s` apart.
struct TrackView {
  const PrivilegedTrack& frames;
  double period_s = 0.1;
};

/// The value a condition is about at one frame, in the unit of its kind.
/// @throws InvalidInput if the frame has no such body.
double Measure(const Condition& condition, const TrackView& track, std::size_t frame);

/// Whether a value satisfies the condition's bounds; a NaN satisfies none.
bool Holds(const Condition& condition, double value);

/// How far a value is from its bounds in units of the bound (of 1 if that is 0); 0 if it holds.
double Shortfall(const Condition& condition, double value);

/// "height_gain of bottle was 0.034 m, wanted above 0.09"
std::string Describe(const Condition& condition, double value);

/// The story of one stage in one episode.
struct StageOutcome {
  bool reached = false;
  std::size_t at_frame = 0;  ///< where it was reached, if it was
  std::string why_not;       ///< the sentence with the numbers
};
/// @param from  the first frame that counts.
StageOutcome Follow(const Stage& stage, const TrackView& track, std::size_t from);

}  // namespace evac
