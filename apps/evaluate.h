#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/store.h"
#include "harness/suite.h"

namespace evac {

/// One part of a run's episodes. Which part an episode is in depends on its pair key alone, so that pairs stay together, and on
/// nothing that could go with its difficulty.
struct Shard {
  int number = 1, of = 1;
  bool Holds(const PairKey& pair) const;
};

struct EvaluateOptions {
  Shard shard;
  bool retry_failed = false;  ///< failed episodes are removed first, and so run again
};

/// Runs every episode of the suite that `store` does not have, judges them, and says on stderr what it does.
/// @returns kOk: every job has a row and the error budget holds; kInternal: interrupted, or the budget is spent.
/// @throws InvalidInput before the first episode if a policy does not fit the suite.
ExitCode Evaluate(const Suite& suite, Store& store, const EvaluateOptions& options);

}  // namespace evac
