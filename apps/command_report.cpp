#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/report_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::string run, out;
  SummaryOptions options;
};

/// Everything that is derived from the run, into one folder. @returns the page's path, which is written last.
fs::path WriteReport(const ReportArguments& arguments) {
  const fs::path folder = arguments.out.empty() ? fs::path(arguments.run) / "report" : fs::path(arguments.out);
  if (folder.extension() == ".html")
    throw InvalidInput("--out: found {}, wanted the name of a folder", folder.string());
  const RunSummary summary = Summarise(ReadRun(Store::Open(arguments.run, Store::Mode::kReadOnly)), arguments.options);
  fs::create_directories(folder);
  const fs::path run_folder = fs::canonical(arguments.run).lexically_relative(fs::canonical(folder));
  for (const ReportFile& file : ReportFiles(summary, {run_folder.generic_string(), "evac " EVAC_VERSION}))
    WriteFileAtomically(folder / file.name, file.bytes);
  return folder / "index.html";
}

}  // namespace

void AddReport(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<ReportArguments>();  // CLI11 fills it after this returns
  CLI::App* command = app.add_subcommand("report", "Write what a run found: a page that opens from disk, and the same for programs.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_option("--judge", arguments->options.judge, "whose verdicts are counted")->capture_default_str();
  command->add_option("--out", arguments->out, "into this folder (default: RUN/report)")->type_name("FOLDER");
  command->add_option("--seed", arguments->options.bootstrap_seed, "of the bootstrap")->capture_default_str();
  command->footer(
      "Examples:\n"
      "  evac report out/demo\n"
      "  evac report out/demo --judge human --out pages/demo\n"
      "Writes index.html, report.json, summary.md, junit.xml, benchmark.json, eval_info.json, badge.svg, rates.csv,\n"
      "verdicts.csv. The page links the run's videos relatively: move both together. docs/read_a_report.md.");
  command->callback([arguments, &exit_code] {
    fmt::print("{}\n", WriteReport(*arguments).string());
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
