#include "apps/judge_with_progress.h"

#include "apps/interrupts.h"
#include "core/error.h"

namespace evac {

void AskedProgress::Show(int done, int total) {
  if (done == 0) {
    progress_.emplace(noun_.c_str(), total, 0);
  } else {
    progress_->Count();
  }
}

JudgeSummary JudgeWithProgress(Judge& judge, Store& store, JudgeOptions options) {
  AskedProgress progress(judge.Name());
  options.interrupted = IsInterrupted;
  options.on_asked = [&](int done, int total) { progress.Show(done, total); };
  JudgeSummary summary = JudgeEpisodes(judge, store, options);
  if (!summary.why_over.empty())
    throw InternalError("{}\n      what was judged is stored; the same command goes on from there", summary.why_over);
  return summary;
}

}  // namespace evac
