#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "apps/commands.h"
#include "apps/warnings.h"
#include "core/file.h"
#include "core/store.h"
#include "reports/correlation_output.h"
#include "reports/pairs_csv.h"
#include "reports/run_correlation.h"

namespace evac {
namespace {

struct CorrelateArguments {
  std::string run, pairs;
  RunCorrelationOptions options;
  bool json = false;
};

std::vector<CorrelationGroup> GroupsOf(const CorrelateArguments& arguments) {
  if (arguments.pairs.empty()) {
    return CorrelateRun(Store::Open(arguments.run, Store::Mode::kReadOnly), arguments.options);
  }
  const PairsCsv csv = ReadPairsCsv(ReadFile(arguments.pairs), arguments.pairs);
  PrintWarnings(csv.warnings);
  return CorrelatePoints(csv.points, arguments.options.correlation);
}

/// The value of that name.
template <typename Enum>
Enum Named(const char* option, const std::string& name, std::initializer_list<Enum> values) {
  std::vector<std::string> names;
  for (const Enum value : values) {
    if (name == Name(value)) return value;
    names.push_back(Name(value));
  }
  throw InvalidInput("{}: found \"{}\", wanted {}", option, name, fmt::join(names, " or "));
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
  CLI::Option* pairs =
      command->add_option("--pairs", arguments->pairs, "CSV of rates instead: group,task,policy,real_sr,sim_sr");
  pairs->type_name("FILE.csv");
  MmrvConvention& convention = options.correlation.convention;
  command
      ->add_option_function<std::string>(
          "--mmrv",
          [&](const std::string& name) {
            convention.gap = Named("--mmrv", name, {MmrvGap::kReal, MmrvGap::kSim});
          },
          "what a wrong order of two policies costs: the difference of their real, or of their sim rates")
      ->type_name("real_gap|sim_gap")
      ->default_str("real_gap");
  command
      ->add_option_function<std::string>(
          "--ties",
          [&](const std::string& name) {
            convention.ties = Named("--ties", name, {MmrvTies::kCode, MmrvTies::kSign, MmrvTies::kLeq});
          },
          "when an order counts as wrong: code, SIMPLER's (S_i > S_j) != (R_i > R_j); sign, opposite signs; leq, with "
          "<=")
      ->type_name("code|sign|leq")
      ->default_str("code");
  command->add_option("--judge", options.judge, "whose verdicts are counted; with commas, of each episode the first who can tell: oracle,classifier")->capture_default_str();
  command->add_option("--world", options.world, "compare only this world with the real one")->type_name("NAME");
  command->add_option("--seed", options.correlation.bootstrap.seed, "of the bootstrap")->capture_default_str();
  command->add_flag("--json", arguments->json, "for programs: docs/formats/correlation_json.md");
  pairs->excludes("--judge", "--world", "--seed");  // a table has neither verdicts nor states, and its worlds are columns
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
