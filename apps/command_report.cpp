#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/chart_files.h"
#include "reports/png.h"
#include "reports/report_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::string run, out, baseline;
  SummaryOptions options;
};

/// Every chart as an SVG and a PNG, for a paper.
void WriteCharts(const ReportData& report, const fs::path& folder) {
  fs::create_directories(folder);
  for (const ChartFile& chart : ChartFilesOf(report)) {
    WriteFileAtomically(folder / (chart.name + ".svg"), chart.svg);
    WriteFileAtomically(folder / (chart.name + ".png"), PngOf(chart.svg));
  }
}

/// Everything that is derived from the run, into one folder. @returns the page's path, which is written last.
fs::path WriteReport(const ReportArguments& arguments) {
  const fs::path folder = arguments.out.empty() ? fs::path(arguments.run) / "report" : fs::path(arguments.out);
  if (folder.extension() == ".html")
    throw InvalidInput("--out: found {}, wanted the name of a folder", folder.string());
  RunSummary summary = Summarise(ReadRun(Store::Open(arguments.run, Store::Mode::kReadOnly)), arguments.options);
  fs::create_directories(folder);
  const fs::path run_folder = fs::canonical(arguments.run).lexically_relative(fs::canonical(folder));
  const ReportData report = ReportDataOf(std::move(summary), {.baseline = arguments.baseline, .trust = {}});
  WriteCharts(report, folder / "charts");
  for (const ReportFile& file : ReportFiles(report, {run_folder.generic_string(), "evac " EVAC_VERSION}))
    WriteFileAtomically(folder / file.name, file.bytes);
  return folder / "index.html";
}

}  // namespace

void AddReport(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<ReportArguments>();  // CLI11 fills it after this returns
  CLI::App* command =
      app.add_subcommand("report", "Write what a run found: a page that opens from disk, and the same for programs.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_option("--judge", arguments->options.judge, "whose verdicts are counted")->capture_default_str();
  command->add_option("--out", arguments->out, "into this folder (default: RUN/report)")->type_name("FOLDER");
  command
      ->add_option("--baseline", arguments->baseline,
                   "the policy others are held against (default: the first declared)")
      ->type_name("NAME@CHECKPOINT");
  command->add_option("--seed", arguments->options.bootstrap_seed, "of the bootstrap")->capture_default_str();
  command->footer(
      "Examples:\n"
      "  evac report out/demo\n"
      "  evac report out/demo --judge human --out pages/demo\n"
      "Writes index.html, report.json, summary.md, junit.xml, benchmark.json, eval_info.json, badge.svg, rates.csv,\n"
      "verdicts.csv, and every chart as charts/*.svg and *.png. The page links the run's videos relatively: move both "
      "together. docs/read_a_report.md.");
  command->callback([arguments, &exit_code] {
    fmt::print("{}\n", WriteReport(*arguments).string());
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
