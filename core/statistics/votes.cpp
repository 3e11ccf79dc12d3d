#include "core/statistics/votes.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/error.h"

namespace evac {

Majority MajorityOf(std::span<const Vote> votes) {
  Majority result;
  result.successes = std::ranges::count(votes, Vote::kSuccess);
  result.unsure = std::ranges::count(votes, Vote::kUnsure);
  const std::int64_t failures = std::ranges::count(votes, Vote::kFailure);
  result.valid = result.successes + failures;
  result.split = result.successes > 0 && failures > 0;
  result.margin = std::abs(result.successes - failures);
  if (result.margin > 0) result.success = result.successes > failures;
  if (result.valid > 0) result.soft = static_cast<double>(result.successes) / static_cast<double>(result.valid);
  return result;
}

BlindingIndex BangBlindingIndex(const BlindingGuesses& guesses) {
  if (std::min({guesses.correct, guesses.incorrect, guesses.unsure}) < 0) {
    throw InvalidInput("statistics: a negative number of guesses");
  }
  BlindingIndex result;
  const double total = static_cast<double>(guesses.correct + guesses.incorrect + guesses.unsure);
  if (total == 0) return result;
  const double right = static_cast<double>(guesses.correct) / total;
  const double wrong = static_cast<double>(guesses.incorrect) / total;
  result.index = right - wrong;
  result.se = std::sqrt(std::max(0.0, right + wrong - (right - wrong) * (right - wrong)) / total);
  return result;
}

}  // namespace evac
