#pragma once

#include <functional>
#include <map>

#include "core/judge.h"
#include "core/store.h"

namespace evac {

struct JudgeOptions {
  bool again = false;  ///< rate also the episodes that have a verdict by this judge
  std::function<void(const Verdict&)> on_verdict = [](const Verdict&) {};  ///< after each one stored, for progress
};

struct JudgeSummary {
  int rated = 0;
  int already = 0;              ///< had a current verdict by this judge
  int failed = 0;               ///< failed episodes: errors, which nobody judges
  std::map<Label, int> labels;  ///< of those rated
};

/// Rates every episode of a store that did not fail and has no verdict by this judge yet, one at a time; each verdict
/// is stored before the next is asked for, so that an interruption loses one at most. A judge that throws gives a
/// verdict `invalid` with the message, never a failure.
/// @throws Error if the store cannot be read or written.
JudgeSummary JudgeEpisodes(Judge& judge, Store& store, const JudgeOptions& options);

}  // namespace evac
