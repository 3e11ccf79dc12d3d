#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// One attempt at a task in a world that has physics, as far as what became of it depends on it.
struct Attempt {
  const Task& task;
  const std::string& object;      ///< the body that the task is about
  const PrivilegedTrack& track;   ///< [T], T >= 1
  const std::vector<Arms>& told;  ///< [T] where the arms were told to be by then; the right arm, the last, works
};

/// What became of an attempt, told from what happened and never from what was meant.
enum class Fate {
  kSuccess,         ///< the rubric's, by the oracle
  kDrop,            ///< lifted, and fell: further than 6 cm, or out of a hand that was told to hold it
  kMisplaced,       ///< lifted and let go, but not where or how it belongs
  kStillHeld,       ///< lifted, and in the hand at the end
  kSlip,            ///< held by both fingers for .3 s, never lifted
  kWrongObject,     ///< both fingers held another thing for .3 s
  kNearMiss,        ///< the hand closed low within 4 cm of the object, or touching it, and did not get it
  kEmptyGrasp,      ///< the hand closed low 4 … 12 cm from it
  kPretendedGrasp,  ///< the hand closed low further away than that, where there is nothing to take
  kPush,            ///< moved by more than 1.5 cm or tipped by more than 25 degrees, without a grasp
  kNoGrasp,         ///< the open or empty hand came within 5 cm of it, or touched it: no more
  kUntouched,       ///< none of these: motion in the air
};
inline constexpr int kFates = 12;
/// "success", "drop", … "untouched": the names that are stored and counted.
const char* Name(Fate fate);

struct WhatHappened {
  Fate fate = Fate::kUntouched;
  std::string reason;  ///< the oracle's sentence
  std::vector<std::uint8_t>
      contact;  ///< [T]: 1 within .4 s of a first touch, a grasp, a release, or a hand that closes low
};

/// @throws InvalidInput if the track has no such object, or the rubric names a body that it has not.
WhatHappened Look(const Attempt& attempt);

}  // namespace evac
