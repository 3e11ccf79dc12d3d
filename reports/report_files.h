#pragma once

#include <string>
#include <vector>

#include "reports/gate_decision.h"
#include "reports/page.h"
#include "reports/summary.h"

namespace evac {

/// One file of a report: its name inside the report's folder, its bytes.
struct ReportFile {
  std::string name, bytes;
};

/// All that `evac report` writes: index.html, report.json, summary.md, junit.xml, benchmark.json, eval_info.json,
/// badge.svg, rates.csv, verdicts.csv (docs/formats has a page for each). A pure function of the run: the same store,
/// the same bytes.
std::vector<ReportFile> ReportFiles(const ReportData& report, const PageOptions& options);

/// What `evac gate --out` writes: gate.json, junit.xml, summary.md, badge.svg, of this decision alone.
std::vector<ReportFile> GateFiles(const RunSummary& summary, const GateDecision& decision);

}  // namespace evac
