#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/commands.h"
#include "core/store.h"
#include "reports/counted_judges.h"
#include "reports/trust_worlds.h"

namespace evac {
namespace {

struct TrustArguments {
  std::string run, world, judge = "oracle";
  TrustOptions options;
  bool json = false;
};

std::vector<std::string> ModelWorlds(const RunSummary& summary, const std::string& wanted) {
  std::vector<std::string> worlds;
  for (const WorldInfo& world : summary.data.worlds) {
    if (!world.is_real && wanted.empty()) worlds.push_back(world.name);
  }
  if (!wanted.empty()) worlds.push_back(wanted);  // complained of later, if it is none
  if (worlds.empty()) throw InvalidInput("trust: the run has no world beside the real one");
  return worlds;
}

/// More episodes, or real trials, would not help whoever asks for a judge that the run has not.
void DemandVerdicts(const RunSummary& summary, const TrustArguments& arguments) {
  const auto counts = [&](const std::string& judge) { return IsCounted(judge, summary.options.judge); };
  if (std::ranges::any_of(summary.judges, counts)) return;
  if (summary.judges.empty()) throw NobodyJudged(arguments.run, arguments.judge);
  throw InvalidInput("--judge: found '{}', wanted one who has judged {}: {}", arguments.judge, arguments.run,
                     fmt::join(summary.judges, ", "));
}

void PrintTrust(const TrustArguments& arguments) {
  const Store store = Store::Open(arguments.run, Store::Mode::kReadOnly);
  SummaryOptions options;
  options.judge = arguments.judge;
  options.bootstrap_replicates = 1;  // its correlations are not shown
  const RunSummary summary = Summarise(ReadRun(store), options);
  DemandVerdicts(summary, arguments);
  const WorldsTrust trust = TrustOfWorlds(summary, ModelWorlds(summary, arguments.world), arguments.options);
  if (trust.worlds.empty()) throw InvalidInput("trust: {}", WhyNothingIsSaid(trust.unsaid));
  if (arguments.json)
    fmt::print("{}\n", TrustJson(trust).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  else
    fmt::print("{}", TrustText(trust));
}

}  // namespace

void AddTrust(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrustArguments>();
  CLI::App* command = app.add_subcommand(
      "trust", "Say for each task whether a world may be trusted, and estimate the real success rates.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_option("--world", arguments->world, "only this one; else every world beside the real one")
      ->type_name("NAME");
  command
      ->add_option("--judge", arguments->judge,
                   "whose verdicts on episodes are counted; with commas, of each the first who can tell: "
                   "oracle,classifier")
      ->capture_default_str();
  command->add_option("--margin", arguments->options.margin, "how far its rate may be from the real one")
      ->capture_default_str();
  command->add_option("--confidence", arguments->options.confidence, "of the intervals")->capture_default_str();
  command->add_option("--seed", arguments->options.bootstrap.seed, "of the bootstrap and of betting's order")
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "for programs: docs/trust.md");
  command->footer(
      "Held against imported real trials (evac import-real) if the run has any, else against its real world.\n"
      "Examples:\n"
      "  evac trust out/demo\n"
      "  evac trust out/demo --world sim --margin 0.15 --json\n"
      "Unknown is an answer: the exit code is 0. A world that nobody could judge is named with the reason.");
  command->callback([arguments, &exit_code] {
    PrintTrust(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
