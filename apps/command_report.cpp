#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/page.h"
#include "reports/report_json.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::string run, out;
  SummaryOptions options;
};

/// The page and, beside it, the same numbers as JSON. @returns the page's path.
fs::path WriteReport(const ReportArguments& arguments) {
  const fs::path page = arguments.out.empty() ? fs::path(arguments.run) / "report.html" : fs::path(arguments.out);
  if (page.extension() != ".html")
    throw InvalidInput("--out: found {}, wanted a name that ends in .html", page.string());
  const RunSummary summary = Summarise(ReadRun(Store::Open(arguments.run, Store::Mode::kReadOnly)), arguments.options);
  const std::string program = "evac " EVAC_VERSION;
  const fs::path folder = fs::absolute(page).lexically_normal().parent_path();
  fs::create_directories(folder);
  const fs::path run_folder = fs::canonical(arguments.run).lexically_relative(fs::canonical(folder));
  WriteFileAtomically(fs::path(page).replace_extension(".json"), ReportJson(summary, program));
  WriteFileAtomically(page, ReportPage(summary, {run_folder.generic_string(), program}));
  return page;
}

}  // namespace

void AddReport(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<ReportArguments>();  // CLI11 fills it after this returns
  CLI::App* command = app.add_subcommand("report", "Write what a run found as one page that opens from disk.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_option("--judge", arguments->options.judge, "whose verdicts are counted")->capture_default_str();
  command->add_option("--out", arguments->out, "the page (default: RUN/report.html); its numbers as .json beside it")
      ->type_name("FILE.html");
  command->add_option("--seed", arguments->options.bootstrap_seed, "of the bootstrap")->capture_default_str();
  command->footer(
      "Examples:\n"
      "  evac report out/demo\n"
      "  evac report out/demo --judge human --out pages/demo.html\n"
      "The page links the run's videos relatively: move both together. How to read it: docs/read_a_report.md.");
  command->callback([arguments, &exit_code] {
    fmt::print("{}\n", WriteReport(*arguments).string());
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
