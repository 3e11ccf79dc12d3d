#pragma once

#include <span>
#include <vector>

#include "core/seed.h"
#include "core/types.h"

namespace evac {

/// What the arms were told, changed as hands err: where the right hand, the last of `told`, closes (by some millimetres to
/// centimetres, and turned about the vertical), where it opens again, and when it does either (by up to four frames).
/// What lies between goes there smoothly. One time in ten nothing is changed: what comes of the same twice is
/// reality's to say. Row 0, where the arms were, stays.
/// @param told  [T], T >= 1, base frame, one period apart
/// @returns     [T]; closures in [0, 1] if they were; poses may leave the workspace: what executes them says so
std::vector<Arms> Varied(std::span<const Arms> told, SplitMix64& random);

}  // namespace evac
