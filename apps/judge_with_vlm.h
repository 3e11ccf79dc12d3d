#pragma once

#include <filesystem>

#include "core/error.h"

namespace evac {

struct VlmJudgeArguments {
  std::filesystem::path run, config;
  bool again = false;    ///< rate also what has a verdict
  bool dry_run = false;  ///< say what it would cost and ask nothing
  bool offline = false;  ///< from the cache alone
  bool retest = false;   ///< ask a share of the episodes a second time
};

/// `evac judge RUN --judge vlm --config PAGE`. The first Ctrl-C ends it in order: nothing more is sent.
/// The page's budget is for all calls about this run by a judge of that name, as judge_calls.sqlite has them.
/// @throws InternalError if it was interrupted, the budget is spent, or the server gave out before the last episode:
/// what was judged is stored, the same command goes on from there. InvalidInput for what is found before the first
/// episode.
ExitCode JudgeWithVlm(const VlmJudgeArguments& arguments);

}  // namespace evac
