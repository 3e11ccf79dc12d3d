#include "reports/report_files.h"

#include "reports/badge.h"
#include "reports/benchmark.h"
#include "reports/eval_info.h"
#include "reports/gate_data.h"
#include "reports/gate_decision.h"
#include "reports/junit.h"
#include "reports/rates_csv.h"
#include "reports/report_json.h"
#include "reports/summary_md.h"
#include "reports/verdicts_csv.h"

namespace evac {

std::vector<ReportFile> ReportFiles(const ReportData& report, const PageOptions& options) {
  const RunSummary& summary = report.summary;
  std::vector<ShownGate> gates;
  if (!summary.data.gates.empty()) gates = LastGates(summary.data.gates, DataHash(summary.data));
  return {{"report.json", ReportJson(report, options.program)},
          {"summary.md", SummaryMarkdown(summary, gates)},
          {"junit.xml", JunitXml(summary, gates)},
          {"benchmark.json", BenchmarkJson(summary)},
          {"eval_info.json", EvalInfoJson(summary)},
          {"badge.svg", BadgeSvg(summary, gates)},
          {"rates.csv", RatesCsv(summary)},
          {"verdicts.csv", VerdictsCsv(summary)},
          {"index.html", ReportPage(report, options)}};
}

std::vector<ReportFile> GateFiles(const RunSummary& summary, const GateDecision& decision) {
  const std::vector<ShownGate> gates = {{decision, true}};
  return {{"gate.json", JsonOf(decision).dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n"},
          {"junit.xml", JunitXml(summary, gates)},
          {"summary.md", SummaryMarkdown(summary, gates)},
          {"badge.svg", BadgeSvg(summary, gates)}};
}

}  // namespace evac
