#include "apps/judge_with_progress.h"

#include <optional>

#include "apps/interrupts.h"
#include "apps/work_share.h"
#include "core/error.h"

namespace evac {

JudgeSummary JudgeWithProgress(Judge& judge, Store& store, bool again) {
  std::optional<CountProgress> progress;
  const auto show = [&](int done, int total) {
    if (done == 0) {
      progress.emplace("episodes judged", total, 0);
    } else {
      progress->Count();
    }
  };
  JudgeSummary summary = JudgeEpisodes(judge, store, {.again = again, .interrupted = IsInterrupted, .on_asked = show});
  if (!summary.why_over.empty())
    throw InternalError("{}\n      what was judged is stored; the same command goes on from there", summary.why_over);
  return summary;
}

}  // namespace evac
