#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>

#include "apps/commands.h"
#include "apps/warnings.h"
#include "core/file.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/chart_files.h"
#include "reports/correlation_output.h"
#include "reports/counted_judges.h"
#include "reports/pairs_csv.h"
#include "reports/png.h"
#include "reports/rates_page.h"
#include "reports/report_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::string run, pairs, out, baseline;
  SummaryOptions options;
  bool names_judge = false;  ///< somebody asked for that one
  bool embed_thumbs = false;
};

/// Every chart as an SVG and a PNG, for a paper.
void WriteCharts(const std::vector<ChartFile>& charts, const fs::path& folder) {
  MakeFolders(folder);
  for (const ChartFile& chart : charts) {
    WriteFileAtomically(folder / (chart.name + ".svg"), chart.svg);
    WriteFileAtomically(folder / (chart.name + ".png"), PngOf(chart.svg));
  }
}

/// Of an earlier report, such as another judge's, that this one has no more. What evac did not write stays.
void RemoveOtherCharts(const std::vector<ChartFile>& charts, const fs::path& folder) {
  std::vector<fs::path> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& file = entry.path();
    const std::string name = file.stem().string();
    if (file.extension() != ".svg" || entry.symlink_status().type() != fs::file_type::regular) continue;
    if (std::ranges::find(charts, name, &ChartFile::name) != charts.end()) continue;
    if (IsChartFile(name, ReadFile(file))) others.push_back(file);
  }
  for (fs::path file : others) {
    fs::remove(file);
    file.replace_extension(".png");
    if (fs::symlink_status(file).type() == fs::file_type::regular) fs::remove(file);
  }
}

void CheckIsFolder(const fs::path& folder) {
  if (folder.extension() == ".html")
    throw InvalidInput("--out: found {}, wanted the name of a folder", folder.string());
}

/// Of a table of rates: the page, what `evac correlate --json` says, the charts. @returns the page's path.
fs::path WriteRatesReport(const ReportArguments& arguments) {
  if (arguments.out.empty()) throw InvalidInput("--pairs: found no --out, wanted the folder to write");
  const fs::path folder = arguments.out;
  CheckIsFolder(folder);
  const PairsCsv csv = ReadPairsCsv(ReadFile(arguments.pairs), arguments.pairs);
  PrintWarnings(csv.warnings);
  const std::vector<CorrelationGroup> groups = CorrelatePoints(csv.points);
  MakeFolders(folder);
  WriteCharts(ChartFilesOf(groups), folder / "charts");
  WriteFileAtomically(folder / "correlation.json", CorrelationJson(groups));
  const std::string source = fs::path(arguments.pairs).filename().string();
  WriteFileAtomically(folder / "index.html", RatesPage(groups, source, "evac " EVAC_VERSION));
  return folder / "index.html";
}

/// The bytes of a thumbnail, empty where it is not there or lies elsewhere than in the run.
std::string ThumbnailOf(const fs::path& run, const std::string& file) {
  const fs::path relative = fs::path(file).lexically_normal();
  const fs::path path = run / relative;
  if (relative.begin()->string() != "thumbs" || relative.extension() != ".jpg" || !fs::is_regular_file(path)) return "";
  return ReadFile(path);
}

/// Nobody need have judged a run that only just began; but who names judges wants their verdicts.
void DemandVerdicts(const RunSummary& summary, const ReportArguments& arguments) {
  const auto counts = [&](const std::string& judge) { return IsCounted(judge, summary.options.judge); };
  if (!arguments.names_judge || std::ranges::any_of(summary.judges, counts)) return;
  throw InvalidInput("--judge: found '{}', wanted one who has judged {}: {}", arguments.options.judge, arguments.run,
                     summary.judges.empty() ? "nobody has yet" : fmt::format("{}", fmt::join(summary.judges, ", ")));
}

/// Everything that is derived from the run, into one folder. @returns the page's path, which is written last.
fs::path WriteReport(const ReportArguments& arguments) {
  const fs::path folder = arguments.out.empty() ? fs::path(arguments.run) / "report" : fs::path(arguments.out);
  CheckIsFolder(folder);
  RunSummary summary = Summarise(ReadRun(Store::Open(arguments.run, Store::Mode::kReadOnly)), arguments.options);
  DemandVerdicts(summary, arguments);
  MakeFolders(folder);
  const fs::path run_folder = fs::canonical(arguments.run).lexically_relative(fs::canonical(folder));
  const ReportData report = ReportDataOf(std::move(summary), {.baseline = arguments.baseline, .trust = {}});
  const std::vector<ChartFile> charts = ChartFilesOf(report);
  WriteCharts(charts, folder / "charts");
  RemoveOtherCharts(charts, folder / "charts");
  PageOptions page;
  page.run_folder = run_folder.generic_string();
  page.program = "evac " EVAC_VERSION;
  if (arguments.embed_thumbs)
    page.embedded = [&](const std::string& file) { return ThumbnailOf(arguments.run, file); };
  for (const ReportFile& file : ReportFiles(report, page))
    WriteFileAtomically(folder / file.name, file.bytes);
  return folder / "index.html";
}

}  // namespace

void AddReport(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<ReportArguments>();  // CLI11 fills it after this returns
  CLI::App* command =
      app.add_subcommand("report", "Write what a run found: a page that opens from disk, and the same for programs.");
  command->add_option("RUN", arguments->run, "folder of a run");
  CLI::Option* pairs = command->add_option(
      "--pairs", arguments->pairs,
      "instead of a run: a CSV of rates, group,task,policy,real_sr,sim_sr (docs/formats/pairs_csv.md)");
  pairs->type_name("FILE.csv");
  const CLI::Option* judge = command->add_option("--judge", arguments->options.judge, "whose verdicts are counted; with commas, of each episode the first who can tell: oracle,classifier")->capture_default_str();
  command->add_option("--out", arguments->out, "into this folder (default: RUN/report)")->type_name("FOLDER");
  command
      ->add_option("--baseline", arguments->baseline,
                   "the policy others are held against (default: the first declared)")
      ->type_name("NAME@CHECKPOINT");
  command->add_option("--seed", arguments->options.bootstrap_seed, "of the bootstrap")->capture_default_str();
  command->add_flag("--embed-thumbs", arguments->embed_thumbs,
                    "thumbnails inside the page: it can be sent alone, without the videos");
  pairs->excludes("--judge", "--baseline", "--seed", "--embed-thumbs");  // a table has no episodes
  command->footer(
      "Examples:\n"
      "  evac report out/demo\n"
      "  evac report out/demo --judge human --out pages/demo\n"
      "  evac report --pairs published.csv --out pages/published\n"
      "Writes index.html, report.json, summary.md, junit.xml, benchmark.json, eval_info.json, badge.svg, rates.csv,\n"
      "verdicts.csv, and every chart as charts/*.svg and *.png. The page links the run's videos relatively: move both "
      "together. docs/read_a_report.md.");
  command->callback([arguments, judge, &exit_code] {
    arguments->names_judge = judge->count() > 0;
    if (arguments->run.empty() == arguments->pairs.empty())
      throw InvalidInput("report: found {}, wanted either a RUN or --pairs FILE.csv",
                         arguments->run.empty() ? "neither" : "both");
    const fs::path page = arguments->run.empty() ? WriteRatesReport(*arguments) : WriteReport(*arguments);
    fmt::print("{}\n", page.string());
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
