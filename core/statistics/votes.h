#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/statistics/estimate.h"

/// Several raters' votes on one item, and whether they could tell what they should not (docs/statistics.md).
namespace evac {

enum class Vote { kSuccess, kFailure, kUnsure, kMissing };

struct Majority {
  std::optional<bool> success;  ///< strict majority of successes and failures; empty: a tie or no vote, adjudicate
  std::int64_t valid = 0;       ///< successes and failures
  std::int64_t successes = 0;
  std::int64_t unsure = 0;
  bool split = false;                        ///< both a success and a failure were given
  std::int64_t margin = 0;                   ///< |successes - failures|
  Number soft = Undefined{"no valid vote"};  ///< successes / valid
};
Majority MajorityOf(std::span<const Vote> votes);

/// Bang's blinding index of one arm: raters guess whether a clip is real or generated. 1: all right; 0: as if blind;
/// below 0: systematically wrong.
struct BlindingGuesses {
  std::int64_t correct = 0, incorrect = 0, unsure = 0;
};
struct BlindingIndex {
  Number index = Undefined{"no guesses"};  ///< (correct - incorrect) / all
  Number se = Undefined{"no guesses"};     ///< multinomial
};
/// @throws InvalidInput if a count is negative.
BlindingIndex BangBlindingIndex(const BlindingGuesses& guesses);

}  // namespace evac
