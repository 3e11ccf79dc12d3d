#include "apps/judge_with_progress.h"

#include <optional>
#include <string>

#include "apps/interrupts.h"
#include "apps/work_share.h"
#include "core/error.h"

namespace evac {

JudgeSummary JudgeWithProgress(Judge& judge, Store& store, JudgeOptions options) {
  const std::string noun = "episodes judged by " + judge.Name();
  std::optional<CountProgress> progress;
  options.interrupted = IsInterrupted;
  options.on_asked = [&](int done, int total) {
    if (done == 0) {
      progress.emplace(noun.c_str(), total, 0);
    } else {
      progress->Count();
    }
  };
  JudgeSummary summary = JudgeEpisodes(judge, store, options);
  if (!summary.why_over.empty())
    throw InternalError("{}\n      what was judged is stored; the same command goes on from there", summary.why_over);
  return summary;
}

}  // namespace evac
