#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// Success rates for github-action-benchmark, tool `customBiggerIsBetter`: an array of {"name", "unit", "value",
/// "range", "extra"}, `value` in percent, `range` half the interval's width ("± 14.2"), `extra` n, interval and method
/// (docs/formats/benchmark_json.md). A rate that is undefined has no entry: the tool knows numbers alone.
/// Source of the fields: README of github.com/benchmark-action/github-action-benchmark, "Custom benchmarks".
std::string BenchmarkJson(const RunSummary& summary);

}  // namespace evac
