#pragma once

#include <optional>
#include <string>

#include "apps/work_share.h"
#include "judges/judge_episodes.h"

namespace evac {

/// Says every few seconds on stderr how many of a judge's episodes it was asked about, and how long the rest will take.
class AskedProgress {
 public:
  explicit AskedProgress(const std::string& judge) : noun_("episodes judged by " + judge) {}
  AskedProgress(const AskedProgress&) = delete;
  AskedProgress& operator=(const AskedProgress&) = delete;

  /// What JudgeOptions::on_asked is told.
  void Show(int done, int total);

 private:
  std::string noun_;
  std::optional<CountProgress> progress_;
};

/// JudgeEpisodes, which says every few seconds on stderr how far it is. Ends in order when IsInterrupted.
/// @param options  whose `interrupted` and `on_asked` are this function's own
/// @throws Error where JudgeEpisodes does; InternalError if it ended early: what was judged is stored
JudgeSummary JudgeWithProgress(Judge& judge, Store& store, JudgeOptions options);

}  // namespace evac
