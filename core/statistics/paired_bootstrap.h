#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/bootstrap.h"
#include "core/statistics/inverted_interval.h"
#include "core/statistics/mmrv.h"
#include "core/statistics/rate_pairs.h"
#include "core/statistics/rates.h"

/// The interval of record of every comparison of worlds (docs/statistics.md): what would the correlation have been, had
/// other initial states of the same kind been drawn? It says nothing about other policies or tasks.
namespace evac {

/// One point: a policy on a task, with its outcomes in each initial state of that task. A state may hold several
/// seeds, or none (0 of 0) where an episode failed.
struct PointOutcomes {
  std::vector<Count> real, sim;  ///< [states of the task], both in the same order
};

/// The points of one task share its initial states: they are resampled together.
struct TaskOutcomes {
  std::vector<PointOutcomes> points;  ///< all with the same number of states
};

/// The rates of all points as they are, tasks in order. A point without trials in one of the worlds is left out.
RatePairs RatesOf(const std::vector<TaskOutcomes>& tasks);

/// One statistic's replicates and intervals.
struct BootstrapOf {
  Resampled resampled;         ///< replicates in the order drawn
  std::int64_t undefined = 0;  ///< replicates dropped because the statistic was undefined there
  BootstrapIntervals intervals;
  /// At any confidence: what is shown and decided from (docs/decisions/0012-interval-of-record.md). The percentile
  /// interval, but undefined where more replicates were dropped than it leaves outside. Where no replicate differs from
  /// another it would have no width: it then holds what the statistic comes to if, in each world, one point whose
  /// outcomes are all alike in n states ends otherwise in a share 1 - tail^(1/n) of them (Clopper-Pearson's end), tail
  /// the half of what it leaves outside.
  IntervalAt of_record;
  /// Why percentile and BCa alone may not be shown at the options' confidence; empty if they may.
  std::string not_as_drawn;
};

struct PairedBootstrap {
  Defined<BootstrapOf> pearson = Undefined{"no points"};
  Defined<BootstrapOf> spearman = Undefined{"no points"};
  Defined<BootstrapOf> mmrv = Undefined{"no points"};
  std::string method;  ///< "paired state bootstrap, percentile, B=2000, seed 0"
};

/// Fewer states of a task cannot be drawn in another way.
inline constexpr std::size_t kMinBootstrapStates = 2;

/// Each replicate draws, task after task, as many of the task's initial states as it has, with replacement, and
/// recomputes the rates of all its policies in both worlds from the same draw. A replicate with a point that has no
/// trial left, or where the statistic is undefined, is dropped and counted. The jackknife leaves out one state at a
/// time. Undefined where a task that has points has fewer than kMinBootstrapStates states.
/// @throws InvalidInput if the points of a task differ in their number of states, or options are out of range.
PairedBootstrap PairedStateBootstrap(const std::vector<TaskOutcomes>& tasks, const MmrvConvention& convention = {},
                                     const BootstrapOptions& options = {});

}  // namespace evac
