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

/// `evac judge RUN --judge vlm --config PAGE`. @returns kInternal if the server gave out before the last episode; the
/// same command goes on from there.
ExitCode JudgeWithVlm(const VlmJudgeArguments& arguments);

}  // namespace evac
