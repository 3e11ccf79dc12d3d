#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "reports/correlation_output.h"
#include "reports/pairs_csv.h"
#include "reports/run_correlation.h"

namespace evac {
namespace {

constexpr std::size_t kMaxWarnings = 20;

struct CorrelateArguments {
  std::string run, pairs;
  RunCorrelationOptions options;
  bool json = false;
};

void Print(const std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < std::min(warnings.size(), kMaxWarnings); ++i)
    fmt::print(stderr, "evac: warning: {}\n", warnings[i]);
  if (warnings.size() > kMaxWarnings)
    fmt::print(stderr, "evac: warning: and {} more like these\n", warnings.size() - kMaxWarnings);
}

std::vector<CorrelationGroup> GroupsOf(const CorrelateArguments& arguments) {
  if (arguments.pairs.empty()) {
    return CorrelateRun(Store::Open(arguments.run, Store::Mode::kReadOnly), arguments.options);
  }
  const PairsCsv csv = ReadPairsCsv(ReadFile(arguments.pairs), arguments.pairs);
  Print(csv.warnings);
  return CorrelatePoints(csv.points, arguments.options.correlation);
}

void Correlate(const CorrelateArguments& arguments) {
  if (arguments.run.empty() == arguments.pairs.empty()) {
    throw InvalidInput("correlate: found {}, wanted either a RUN or --pairs FILE.csv",
                       arguments.run.empty() ? "neither" : "both");
  }
  const std::vector<CorrelationGroup> groups = GroupsOf(arguments);
  fmt::print("{}", arguments.json ? CorrelationJson(groups) : CorrelationText(groups));
}

}  // namespace

void AddCorrelate(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<CorrelateArguments>();  // CLI11 fills it after this returns
  RunCorrelationOptions& options = arguments->options;
  CLI::App* command =
      app.add_subcommand("correlate", "Say how well another world's success rates follow the real world's.");
  command->add_option("RUN", arguments->run, "folder of a run: its real world against each other");
  command->add_option("--pairs", arguments->pairs, "CSV of rates instead: group,task,policy,real_sr,sim_sr")
      ->type_name("FILE.csv");
  command
      ->add_option("--mmrv", options.correlation.convention.gap,
                   "what a wrong order of two policies costs: the difference of their real, or of their sim rates")
      ->transform(
          CLI::Transformer(std::map<std::string, MmrvGap>{{"real_gap", MmrvGap::kReal}, {"sim_gap", MmrvGap::kSim}}))
      ->type_name("real_gap|sim_gap")
      ->default_str("real_gap");
  command
      ->add_option("--ties", options.correlation.convention.ties,
                   "when an order counts as wrong: code, SIMPLER's (S_i > S_j) != (R_i > R_j); sign, opposite signs; "
                   "leq, with <=")
      ->transform(CLI::Transformer(std::map<std::string, MmrvTies>{
          {"code", MmrvTies::kCode}, {"sign", MmrvTies::kSign}, {"leq", MmrvTies::kLeq}}))
      ->type_name("code|sign|leq")
      ->default_str("code");
  command->add_option("--judge", options.judge, "whose verdicts are counted")->capture_default_str();
  command->add_option("--world", options.world, "compare only this world with the real one")->type_name("NAME");
  command->add_option("--seed", options.correlation.bootstrap.seed, "of the bootstrap")->capture_default_str();
  command->add_flag("--json", arguments->json, "for programs: docs/formats/correlation_json.md");
  command->footer(
      "Examples:\n"
      "  evac correlate out/demo\n"
      "  evac correlate out/demo --world sim --json\n"
      "  evac correlate --pairs rates.csv --mmrv sim_gap --ties sign\n"
      "What is undefined is printed so, with the reason (JSON: null), and still ends with 0.");
  command->callback([arguments, &exit_code] {
    Correlate(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
