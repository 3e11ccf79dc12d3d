#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/commands.h"
#include "apps/warnings.h"
#include "core/file.h"
#include "core/run_extent.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/counted_judges.h"
#include "reports/gate.h"
#include "reports/gate_output.h"
#include "reports/report_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct GateArguments {
  std::string rules, run, baseline;
  std::string out;  ///< of the files; of pin: the pinned file
  std::string judge = "oracle";
  SummaryOptions options;
  bool names_seed = false;  ///< somebody asked for that one
  bool json = false;
};

RunSummary SummaryOf(const std::string& run, const std::string& judge, SummaryOptions options) {
  options.judge = judge;
  return Summarise(ReadRun(Store::Open(run, Store::Mode::kReadOnly)), options);
}

/// Without the bootstrap of correlations, which a pinned result does not hold.
PinnedResult PinRun(const std::string& run, const std::string& judge) {
  SummaryOptions options;
  options.bootstrap_replicates = 1;
  const RunSummary summary = SummaryOf(run, judge, options);
  const RunExtent extent = ExtentOf(summary.data.plan, summary.data.episodes);
  if (extent.missing > 0)  // pairs refuse a candidate that has them all, and rates are of what came first
    PrintWarnings({fmt::format("{}: {} of {} episodes are there, and a baseline is a whole run: evac resume runs the "
                               "others, evac merge adds those of other shards",
                               run, extent.planned - extent.missing, extent.planned)});
  return Pin(summary, run);
}

/// A baseline in which nothing succeeded or failed would be found out by the first candidate, long after.
/// @param field  where the judge is said
void DemandOutcomes(const PinnedResult& pinned, const std::string& run, const std::string& judge,
                    const std::string& field) {
  for (const PinnedCell& cell : pinned.cells) {
    if (std::ranges::any_of(cell.outcomes, &PinnedOutcome::Counts)) return;
  }
  throw InvalidInput(
      "{}: judge {}: found no episode that succeeded or failed, wanted a judge of this run (evac ls) as {}", run, judge,
      field);
}

std::optional<PinnedResult> BaselineOf(const GateArguments& arguments, const GateRules& rules) {
  if (arguments.baseline.empty()) return std::nullopt;
  if (!fs::is_directory(arguments.baseline)) return ReadPinned(ReadFile(arguments.baseline), arguments.baseline);
  PinnedResult pinned = PinRun(arguments.baseline, rules.judge);
  if (std::ranges::any_of(rules.rules, &GateRule::Compares))
    DemandOutcomes(pinned, arguments.baseline, rules.judge, "the field judge of " + arguments.rules);
  return pinned;
}

/// A run that is being written cannot take it: the decision stands, and the bets stay valid, they only forget.
void Keep(const GateResult& result, const std::string& run) {
  const GateDecision& decision = result.decision;
  try {
    Store::Open(run, Store::Mode::kReadWrite)
        .AddGateRecord({decision.Key(), decision.name, Name(decision.outcome),
                        JsonOf(decision).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)},
                       result.looks);
  } catch (const Error& error) {
    fmt::print(stderr, "evac: warning: this decision was not kept: {}\n", error.what());
  }
}

/// A stored decision that others of its gate came after is the last again: it is what this run came to now.
void KeepLast(const std::vector<GateRecord>& records, std::vector<GateRecord>::const_iterator stored,
              const std::string& run) {
  if (std::none_of(stored + 1, records.end(), [&](const GateRecord& later) { return later.gate == stored->gate; }))
    return;
  try {
    Store::Open(run, Store::Mode::kReadWrite).RepeatGateRecord(stored->key);
  } catch (const Error& error) {
    fmt::print(stderr, "evac: warning: that this decision stands again was not kept: {}\n", error.what());
  }
}

bool AskForCorrelation(const GateRules& rules) {
  return std::ranges::any_of(rules.rules, [](const GateRule& rule) { return rule.test == GateTest::kCorrelation; });
}

/// Correlations are asked for by few rules, and told in summary.md; the others need not wait for their bootstrap.
SummaryOptions OptionsFor(const GateRules& rules, const GateArguments& arguments) {
  SummaryOptions options = arguments.options;
  if (!AskForCorrelation(rules) && arguments.out.empty()) options.bootstrap_replicates = 1;
  return options;
}

/// More episodes would decide nothing by a judge who gives no verdicts. Of a run that nobody has judged yet they would.
void DemandTheJudge(const GateRules& rules, const RunSummary& summary, const GateArguments& arguments) {
  const auto counts = [&](const std::string& judge) { return IsCounted(judge, summary.options.judge); };
  const auto needs_none = [](const GateRule& rule) { return rule.test == GateTest::kErrorShare; };
  if (summary.judges.empty() || std::ranges::any_of(summary.judges, counts)) return;
  if (std::ranges::all_of(rules.rules, needs_none)) return;
  throw InvalidInput("{}: field judge: found '{}', wanted one who has judged {}: {}", arguments.rules, rules.judge,
                     arguments.run, fmt::join(summary.judges, ", "));
}

/// The stored decision where these rules, this baseline and these data have been decided before; else a new one, kept.
GateDecision DecisionOf(const GateRules& rules, const RunSummary& summary, const GateArguments& arguments) {
  const std::optional<PinnedResult> baseline = BaselineOf(arguments, rules);
  const auto looks = Store::Open(arguments.run, Store::Mode::kReadOnly).Looks();
  const GateResult result = Decide(rules, {summary, arguments.run, looks}, baseline ? &*baseline : nullptr);
  const auto& records = summary.data.gates;
  const auto stored = std::ranges::find(records, result.decision.Key(), &GateRecord::key);
  if (stored != records.end()) {
    if (arguments.names_seed)
      fmt::print(stderr, "evac: note: --seed: this was decided before, and that decision stands\n");
    KeepLast(records, stored, arguments.run);
    return GateDecisionFromJson(stored->document);
  }
  Keep(result, arguments.run);
  return result.decision;
}

/// @param summary  what was decided of: a run in progress has other episodes by now
void WriteFiles(const RunSummary& summary, const GateDecision& decision, const fs::path& folder) {
  MakeFolders(folder);
  for (const ReportFile& file : GateFiles(summary, decision)) WriteFileAtomically(folder / file.name, file.bytes);
}

ExitCode ExitCodeOf(GateOutcome outcome) {
  return outcome == GateOutcome::kPass   ? ExitCode::kOk
         : outcome == GateOutcome::kFail ? ExitCode::kNo
                                         : ExitCode::kInconclusive;
}

ExitCode Gate(const GateArguments& arguments) {
  const GateRules rules = ReadGateRules(Config::FromFile(arguments.rules));
  if (arguments.run.empty()) {  // before the run: what it will take
    const std::optional<PinnedResult> baseline = BaselineOf(arguments, rules);
    if (baseline) DemandBaseline(rules, *baseline);
    for (const std::string& size : SizesOf(rules, baseline ? &*baseline : nullptr)) fmt::print("{}.\n", size);
    return ExitCode::kOk;
  }
  if (arguments.names_seed && !AskForCorrelation(rules))
    throw InvalidInput("--seed: no rule of {} is a correlation, and only these draw: wanted none", arguments.rules);
  const RunSummary summary = SummaryOf(arguments.run, rules.judge, OptionsFor(rules, arguments));
  DemandTheJudge(rules, summary, arguments);
  const GateDecision decision = DecisionOf(rules, summary, arguments);
  if (arguments.json) {
    fmt::print("{}\n", JsonOf(decision).dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    fmt::print("{}", GateText(decision));
  }
  if (!arguments.out.empty()) WriteFiles(summary, decision, arguments.out);
  return ExitCodeOf(decision.outcome);
}

void AddPin(CLI::App& gate, ExitCode& exit_code) {
  const auto arguments = std::make_shared<GateArguments>();
  CLI::App* command =
      gate.add_subcommand("pin", "Keep what a run came to as a baseline, in one file with its own hash.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_option("--out", arguments->out, "the file")->type_name("PINNED.json")->required();
  command->add_option("--judge", arguments->judge, "whose verdicts are pinned")->capture_default_str();
  command->callback([arguments, &exit_code] {
    RefuseFolder(arguments->out);
    const PinnedResult pinned = PinRun(arguments->run, arguments->judge);
    DemandOutcomes(pinned, arguments->run, arguments->judge, "--judge");
    MakeFolders(fs::path(arguments->out).parent_path());
    WriteFileAtomically(arguments->out, PinnedJson(pinned));
    fmt::print("{}\n", pinned.sha256);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace

void AddGate(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<GateArguments>();
  CLI::App* command =
      app.add_subcommand("gate", "Decide by rules whether a candidate is good enough: pass, fail or inconclusive.");
  command->require_subcommand(0, 1);
  command->add_option("RULES", arguments->rules, "the rules")->type_name("RULES.yaml");
  CLI::Option* run = command->add_option("RUN", arguments->run,
                                         "folder of the candidate's run; without: only how many episodes it takes");
  command->add_option("--baseline", arguments->baseline, "what to compare with: a run, or what `evac gate pin` wrote")
      ->type_name("RUN|PINNED.json");
  command->add_option("--out", arguments->out, "also junit.xml, summary.md, badge.svg and gate.json, into this folder")
      ->needs(run)
      ->type_name("FOLDER");
  CLI::Option* seed = command->add_option("--seed", arguments->options.bootstrap_seed,
                                          "of the bootstrap of rules that are correlations");
  seed->needs(run)->capture_default_str();
  command->add_flag("--json", arguments->json, "for programs: docs/formats/gate_json.md")->needs(run);
  command->footer(
      "Examples:\n"
      "  evac gate pin out/main --out baseline.json\n"
      "  evac gate gate.yaml --baseline baseline.json\n"
      "  evac gate gate.yaml out/candidate --baseline baseline.json --out out/candidate/gate\n"
      "Exit codes: 0 pass, 1 fail, 2 invalid, 3 inconclusive. The decision is kept in the candidate's run: the same "
      "rules,\n"
      "baseline and data get the same answer. docs/gate.md.");
  AddPin(*command, exit_code);
  RefuseOptionsBeforeSubcommands(*command);
  command->callback([arguments, command, seed, &exit_code] {
    if (!command->get_subcommands().empty()) return;  // pin has done it
    arguments->names_seed = seed->count() > 0;
    if (arguments->rules.empty()) throw InvalidInput("gate: RULES: found nothing, wanted RULES.yaml (see --help)");
    exit_code = Gate(*arguments);
  });
}

}  // namespace evac
