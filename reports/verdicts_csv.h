#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// Every judge's current verdict on every episode, a row each, in the order of the episodes, then of the judges' names;
/// an episode that nobody judged has one row without a judge (docs/formats/verdicts_csv.md). Columns: episode, task,
/// initial_state, policy, checkpoint, world, seed, stop, failed, judge, label, probability, stages, reason,
/// rubric_version, video. `stages` is a JSON object stage → reached; undefined is an empty cell.
std::string VerdictsCsv(const RunSummary& summary);

}  // namespace evac
