#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/judge.h"
#include "core/store.h"

namespace evac {

struct JudgeOptions {
  bool again = false;  ///< rate also the episodes that have a verdict by this judge
  std::vector<std::string> also_called = {};  ///< other names under which this judge gives verdicts of episodes
  std::function<bool(const Episode&)> wanted = [](const Episode&) { return true; };  ///< others are left alone
  std::function<bool()> interrupted = [] {
    return false;
  };  ///< asked before each episode: the rest is left for another time
  std::function<void(const Verdict&)> on_verdict = [](const Verdict&) {};  ///< after each one stored, for progress
  /// Once before the first episode the judge is asked about (done 0), then after each, rated or left out.
  std::function<void(int done, int total)> on_asked = [](int, int) {};
};

struct JudgeSummary {
  int rated = 0;
  int already = 0;              ///< had a current verdict by this judge, under any of its names
  int failed = 0;               ///< failed episodes: errors, which nobody judges
  int left_out = 0;             ///< the judge had nothing to judge by (an Error called not_judged)
  std::map<Label, int> labels;  ///< of those rated
  std::string why_over;         ///< why the rest was not judged (interrupted, or an Error called judge_over), or empty
};

/// "60 rated (42 success, 18 failure), 0 had a verdict already, 1 failed episodes are not judged"
std::string Sentence(const JudgeSummary& summary);

/// Rates every episode of a store that did not fail and has no verdict by this judge yet, one at a time; each verdict
/// is stored before the next is asked for, so that an interruption loses one at most. A judge that throws gives a
/// verdict `invalid` with the message, never a failure; but after an Error called `not_judged` or `judge_over`
/// (Error::Called) nothing is stored of that episode, and after the second the rest is left for another time.
/// What is not a clip's doing (an Error that is internal, no memory) ends it: that episode can be asked about again.
/// @throws Error if the store cannot be read or written.
JudgeSummary JudgeEpisodes(Judge& judge, Store& store, const JudgeOptions& options);

}  // namespace evac
