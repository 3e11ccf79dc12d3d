#pragma once

#include <string>

#include "reports/report_data.h"

namespace evac {

/// Raised when a key changes its meaning or goes; new keys do not raise it.
inline constexpr int kReportJsonSchema = 1;

/// The page for programs, all its parts, indented; docs/formats/report.schema.json is its schema and
/// docs/read_a_report.md names the keys. Every estimate is {"value", "interval", "confidence", "n", "method"}; what is
/// undefined is null beside "value_reason" or "interval_reason". The same run gives the same bytes.
std::string ReportJson(const ReportData& report, const std::string& program);
/// The same of a run that has been counted only so far.
std::string ReportJson(const RunSummary& summary, const std::string& program);

}  // namespace evac
