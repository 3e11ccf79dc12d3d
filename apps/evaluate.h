#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/store.h"
#include "harness/suite.h"

namespace evac {

/// One part of a run's episodes. Which part an episode is in depends on its pair key without the seed: so pairs stay together,
/// and so do a state's repeats, all of which are imagined from the first frame that the real world showed with the lowest
/// seed; and on nothing that could go with its difficulty.
struct Shard {
  int number = 1, of = 1;
  bool Holds(const PairKey& pair) const;
  /// " --shard 2/4"; nothing where it is the whole.
  std::string Option() const;
};

struct EvaluateOptions {
  Shard shard = {};
  bool retry_failed = false;  ///< the shard's failed episodes run again: each keeps its row until the new try is over
  std::string go_on = "";     ///< the command that goes on with this run, without its shard; empty: `evac resume` alone does
  std::string part_of = "";   ///< the command whose part this run is ("evac fidelity"): it goes on with the run itself
};

/// Runs every episode of the suite's shard that `store` does not have, judges what is there, each policy's episodes in a
/// world once they are through, and says on stderr what it does.
/// @returns kOk: every job has a row and the error budget holds; kInternal: interrupted, or the budget is spent.
/// @throws InvalidInput before the first episode if a policy cannot be started or does not fit the suite.
ExitCode Evaluate(const Suite& suite, Store& store, const EvaluateOptions& options);

}  // namespace evac
