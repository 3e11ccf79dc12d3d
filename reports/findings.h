#pragma once

#include <string>
#include <vector>

#include "reports/summary.h"

namespace evac {

/// Whether the numbers suffice for an answer. `kNote` is a fact beside the question.
enum class Decision { kYes, kNo, kNotDecided, kNote };
/// "yes", "no", "not decided", "note".
const char* Name(Decision decision);

/// One question a reader has, answered in one sentence with its numbers.
struct Finding {
  Decision decision = Decision::kNote;
  std::string question;  ///< "Does sim tell which policy is better?"
  std::string answer;    ///< the sentence
};

/// Pearson's interval must lie above this before a world is said to follow the real one closely.
inline constexpr double kCloseCorrelation = 0.7;
/// Exact tests decide below this; which policy is best, what the letters rest on (letters.h).
inline constexpr double kAlpha = 0.05;

/// The sentences at the top of the page, most important first. The wording follows the intervals: wide or undefined
/// ones give "not decided", never a guess.
std::vector<Finding> FindingsOf(const RunSummary& summary);

}  // namespace evac
