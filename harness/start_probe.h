#pragma once

#include <string>
#include <vector>

#include "core/policy.h"
#include "core/types.h"
#include "core/world.h"
#include "harness/job.h"

namespace evac {

/// One sign that a policy keeps to other conventions than it declared.
struct Suspicion {
  std::string sentence;     ///< with the numbers: "right arm: the first target is 0.61 m from where the arm is …"
  bool is_certain = false;  ///< no robot could follow it; else it is only unusual
};

/// Beyond these nobody's first targets go: a first target is due one period after the observation.
inline constexpr double kLongestFirstStep_m = 0.25;
inline constexpr double kLargestFirstTurn_rad = 1.2;
inline constexpr double kFastestTarget_m_s = 3;
inline constexpr double kSuddenClosure = 0.5;

/// What a first chunk gives away (docs/conventions.md: what can be seen so, and what cannot): quaternions in another
/// order, deltas or millimetres for absolute metres, swapped arms, degrees, another period; a reversed hand, perhaps.
/// @param observed  where the arms are; @param chunk  finite, with these arms.
std::vector<Suspicion> StartSuspicions(const Arms& observed, const ActionChunk& chunk, const Task& task);

/// Begins `job` on both sides, in scene 0, asks for one chunk and looks at it; nothing is executed or kept. A policy
/// that gives none is not suspicious: its episodes will say why.
std::vector<Suspicion> ProbeStart(Policy& policy, World& world, const Job& job);

}  // namespace evac
