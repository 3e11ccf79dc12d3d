#include "reports/outcome.h"

#include <array>

namespace evac {

const char* Name(Outcome outcome) {
  static constexpr std::array<const char*, kOutcomes> kNames = {"success", "failure", "cannot_tell",
                                                                "invalid", "error",   "unjudged"};
  return kNames.at(static_cast<std::size_t>(outcome));
}

std::string Words(Outcome outcome) {
  if (outcome == Outcome::kCannotTell) return "cannot tell";
  if (outcome == Outcome::kUnjudged) return "not judged";
  return Name(outcome);
}

std::string CountInWords(Outcome outcome, std::int64_t count) {
  return std::to_string(count) + " " + Words(outcome) + (outcome == Outcome::kError && count != 1 ? "s" : "");
}

Outcome OutcomeOf(const Episode& episode, const std::optional<Verdict>& verdict) {
  return OutcomeOf(IsFailure(episode.stop), verdict ? std::optional(verdict->label) : std::nullopt);
}

Outcome OutcomeOf(bool failed, std::optional<Label> label) {
  if (failed) return Outcome::kError;
  if (!label) return Outcome::kUnjudged;
  switch (*label) {
    case Label::kSuccess:
      return Outcome::kSuccess;
    case Label::kFailure:
      return Outcome::kFailure;
    case Label::kCannotTell:
      return Outcome::kCannotTell;
    case Label::kInvalid:
      return Outcome::kInvalid;
  }
  return Outcome::kInvalid;
}

std::string PolicyLabel(const std::string& name, const std::string& checkpoint) {
  return checkpoint.empty() ? name : name + "@" + checkpoint;
}

}  // namespace evac
