#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "reports/outcome.h"

namespace evac {

struct RateCell;

/// What letters rest on.
struct LetterTests {
  std::int64_t pairs = 0;  ///< in the largest family of a world; 0: nobody to differ from
  std::set<std::string> unpaired_tests = {};  ///< of those that were compared as two samples: "Boschloo", "Newcombe"
};

/// Gives each cell its letters: within a task and a world, policies share one exactly if their difference is not
/// significant (compact letter display, Piepho 2004). Exact McNemar over the (state, seed) pairs where both count; where
/// fewer than 80 % are shared, BoschlooOrNewcombe over all that count, as `evac compare` does. Both on the effective
/// number where initial states repeat. Holm over all pairs of policies that a world shows, over all its tasks.
/// @param alpha  in (0, 1): of the whole family
LetterTests GiveLetters(const std::vector<JudgedEpisode>& episodes, double alpha, std::vector<RateCell>& cells);

}  // namespace evac
