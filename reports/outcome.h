#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "core/types.h"

namespace evac {

/// What one episode counts as, for one judge. Only the first two are in a rate.
enum class Outcome { kSuccess, kFailure, kCannotTell, kInvalid, kError, kUnjudged };
inline constexpr std::size_t kOutcomes = 6;

/// "success", "failure", "cannot_tell", "invalid", "error", "unjudged".
const char* Name(Outcome outcome);
/// For people: "cannot tell", "not judged", the rest as they are.
std::string Words(Outcome outcome);
/// "1 error", "2 errors", "3 cannot tell".
std::string CountInWords(Outcome outcome, std::int64_t count);

struct JudgedEpisode {
  Episode episode;
  Outcome outcome = Outcome::kUnjudged;
  std::optional<Verdict> verdict;  ///< of the judge that is counted, if it gave one
  bool Counts() const { return outcome == Outcome::kSuccess || outcome == Outcome::kFailure; }
};

/// An episode that could not go on is an error, whatever a judge says of it.
Outcome OutcomeOf(const Episode& episode, const std::optional<Verdict>& verdict);
/// The same of what the store tells of it.
Outcome OutcomeOf(bool failed, std::optional<Label> label);

/// "visual_pick@good"; the name alone without a checkpoint.
std::string PolicyLabel(const std::string& name, const std::string& checkpoint);

}  // namespace evac
