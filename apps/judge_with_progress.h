#pragma once

#include "judges/judge_episodes.h"

namespace evac {

/// JudgeEpisodes, which says every few seconds on stderr how far it is. Ends in order when IsInterrupted.
/// @param options  whose `interrupted` and `on_asked` are this function's own
/// @throws Error where JudgeEpisodes does; InternalError if it ended early: what was judged is stored
JudgeSummary JudgeWithProgress(Judge& judge, Store& store, JudgeOptions options);

}  // namespace evac
