#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// Raised when a key changes its meaning or goes; new keys do not raise it.
inline constexpr int kReportJsonSchema = 1;

/// The page's numbers for programs: {"schema", "findings", "rates", "comparisons", "gates", "episodes",
/// "counters", "provenance"}, indented; docs/formats/report.schema.json is its schema. Every estimate is {"value", "interval", "confidence", "n", "method"}; what is undefined is
/// null beside "value_reason" or "interval_reason". docs/read_a_report.md names the keys. The same run gives the same
/// bytes.
std::string ReportJson(const RunSummary& summary, const std::string& program);

}  // namespace evac
