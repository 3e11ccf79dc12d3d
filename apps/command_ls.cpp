#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "apps/commands.h"
#include "core/store.h"
#include "reports/counted_judges.h"
#include "reports/tally.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

struct LsArguments {
  std::string run;
  bool json = false;
  bool failed = false;
  bool rates = false;
  std::string judge = "oracle";  ///< whose verdicts the rates count
  bool names_judge = false;      ///< somebody asked for that one
  std::string world, task, policy;  ///< empty: all
};

/// Judge → the label that counts now.
using Labels = std::map<std::string, Label>;

struct Listed {
  Episode episode;
  Labels labels;
};

struct Listing {
  std::vector<Listed> episodes;
  std::map<std::string, Counters> wire;  ///< by policy: how it misbehaved
};

bool IsWanted(const Episode& episode, const LsArguments& arguments) {
  const auto fits = [](const std::string& wanted, const std::string& found) {
    return wanted.empty() || wanted == found;
  };
  return fits(arguments.world, episode.key.world) && fits(arguments.task, episode.key.pair.task) &&
         fits(arguments.policy, episode.key.pair.policy) && (!arguments.failed || IsFailure(episode.stop));
}

/// A name that nothing has is a slip of the keyboard, not a wish for an empty list.
void DemandKnown(const char* option, const std::string& wanted, const std::set<std::string>& known) {
  if (wanted.empty() || known.contains(wanted)) return;
  throw InvalidInput("{}: found '{}', wanted one of: {}", option, wanted, fmt::join(known, ", "));
}

void Check(const LsArguments& arguments, const Store& store) {
  std::set<std::string> worlds, tasks, policies;
  for (const WorldInfo& world : store.Worlds()) worlds.insert(world.name);
  for (const Task& task : store.Tasks()) tasks.insert(task.id);
  for (const PolicyInfo& policy : store.Policies()) policies.insert(policy.name);
  DemandKnown("--world", arguments.world, worlds);
  DemandKnown("--task", arguments.task, tasks);
  DemandKnown("--policy", arguments.policy, policies);
}

Listing List(const LsArguments& arguments) {
  const Store store = Store::Open(arguments.run, Store::Mode::kReadOnly);
  Check(arguments, store);
  const std::vector<Episode> episodes = store.Episodes();  // before the verdicts: each verdict read has its episode
  const auto verdicts = store.CurrentVerdicts();
  Listing list{{}, store.CountersByPolicy()};
  for (const Episode& episode : episodes) {
    if (!IsWanted(episode, arguments)) continue;
    Listed& listed = list.episodes.emplace_back(Listed{episode, {}});
    const auto found = verdicts.find(episode.key.Id());
    if (found == verdicts.end()) continue;
    for (const auto& [judge, verdict] : found->second) listed.labels[judge] = verdict.label;
  }
  return list;
}

Json TextOrNull(const std::string& text) { return text.empty() ? Json() : Json(text); }

Json AsJson(const Listed& listed) {
  const Episode& episode = listed.episode;
  const PairKey& pair = episode.key.pair;
  Json verdicts = Json::object();
  for (const auto& [judge, label] : listed.labels) verdicts[judge] = Name(label);
  return {{"task", pair.task},
          {"initial_state", pair.initial_state},
          {"policy", pair.policy},
          {"checkpoint", pair.checkpoint},
          {"world", episode.key.world},
          {"seed", pair.seed},
          {"stop", Name(episode.stop)},
          {"stop_reason", episode.stop_reason},
          {"chunks", episode.chunks},
          {"failure", TextOrNull(episode.failure)},
          {"video", TextOrNull(episode.video)},
          {"video_sha256", TextOrNull(episode.video_sha256)},
          {"verdicts", verdicts}};
}

void PrintJson(const std::vector<Listed>& list) {
  Json array = Json::array();
  for (const Listed& listed : list) array.push_back(AsJson(listed));
  // A policy's own words may be no UTF-8; the list is to be readable all the same.
  fmt::print("{}\n", array.dump(2, ' ', false, Json::error_handler_t::replace));
}

std::string Shown(const Labels& labels) {
  std::string shown;
  for (const auto& [judge, label] : labels)
    shown += fmt::format("{}{}={}", shown.empty() ? "" : " ", judge, Name(label));
  return shown.empty() ? "-" : shown;
}

using Row = std::vector<std::string>;

std::vector<Row> Rows(const std::vector<Listed>& list) {
  std::vector<Row> rows = {{"TASK", "INITIAL STATE", "POLICY", "SEED", "WORLD", "CHUNKS", "STOP", "VERDICTS"}};
  for (const auto& [episode, labels] : list) {
    const PairKey& pair = episode.key.pair;
    rows.push_back({pair.task, pair.initial_state, pair.policy + "@" + pair.checkpoint, std::to_string(pair.seed),
                    episode.key.world, std::to_string(episode.chunks), Name(episode.stop), Shown(labels)});
  }
  return rows;
}

/// What came over the wire that was no plain answer, or not at once: effort, no part of a result.
void PrintWire(const std::map<std::string, Counters>& wire) {
  for (const auto& [policy, counters] : wire) {
    std::vector<std::string> counted;
    for (const auto& [name, count] : counters) {
      if (count > 0) counted.push_back(fmt::format("{} {}", count, name));
    }
    if (!counted.empty()) fmt::print("wire: {}: {}\n", policy, fmt::join(counted, ", "));
  }
}

void PrintTable(const std::vector<Listed>& list) {
  fmt::print("{}", TextTable(Rows(list)));
  std::set<std::string> tasks, policies, worlds;
  std::size_t failed = 0, judged = 0;
  for (const auto& [episode, labels] : list) {
    tasks.insert(episode.key.pair.task);
    policies.insert(episode.key.pair.policy + "@" + episode.key.pair.checkpoint);
    worlds.insert(episode.key.world);
    failed += IsFailure(episode.stop);
    judged += !labels.empty();
    if (IsFailure(episode.stop))
      fmt::print("{}failed: {}: {}\n", failed == 1 ? "\n" : "", episode.key.Id(), episode.failure);
  }
  const auto counted = [](std::size_t count, const char* one, const char* many) {
    return fmt::format("{} {}", count, count == 1 ? one : many);
  };
  fmt::print("\n{} ({}, {}, {}), {} failed, {} judged\n", counted(list.size(), "episode", "episodes"),
             counted(tasks.size(), "task", "tasks"), counted(policies.size(), "policy", "policies"),
             counted(worlds.size(), "world", "worlds"), failed, judged);
}

/// The full name of the one judge whose verdicts are counted. Nobody need have judged a run that only just began; but
/// who names a judge wants that one.
std::string JudgeOf(const LsArguments& arguments, const Store& store) {
  if (arguments.judge.find(',') != std::string::npos)
    throw InvalidInput("--judge: found {}, wanted one judge; `evac report` counts the first of several who can tell",
                       arguments.judge);
  const std::vector<std::string> judges = store.Judges();
  const std::string full = FullJudgeNames(arguments.judge, judges);
  if (!arguments.names_judge) return full;
  if (judges.empty()) throw InvalidInput("--judge: found '{}', but nobody has judged this run yet", arguments.judge);
  DemandKnown("--judge", full, {judges.begin(), judges.end()});
  return full;
}

/// Rates of a run of any length: counted while its rows are read.
void PrintRates(const LsArguments& arguments) {
  const Store store = Store::Open(arguments.run, Store::Mode::kReadOnly);
  Check(arguments, store);
  std::vector<Row> rows = {{"TASK", "POLICY", "WORLD", "EPISODES", "RATE", "NOT COUNTED"}};
  for (const RateCell& cell : TallyRates(store, JudgeOf(arguments, store), SummaryOptions().confidence)) {
    const std::string policy = cell.policy.substr(0, cell.policy.find('@'));
    if ((!arguments.world.empty() && cell.world != arguments.world) ||
        (!arguments.task.empty() && cell.task != arguments.task) ||
        (!arguments.policy.empty() && policy != arguments.policy))
      continue;
    std::vector<std::string> apart;
    for (const Outcome outcome : {Outcome::kCannotTell, Outcome::kInvalid, Outcome::kError, Outcome::kUnjudged})
      if (cell.Of(outcome) > 0) apart.push_back(CountInWords(outcome, cell.Of(outcome)));
    const std::int64_t counted = cell.Of(Outcome::kSuccess) + cell.Of(Outcome::kFailure);
    rows.push_back({cell.task, cell.policy, cell.world, std::to_string(counted + cell.Apart()),
                    PercentWithInterval(cell.rate), apart.empty() ? "-" : fmt::format("{}", fmt::join(apart, ", "))});
  }
  fmt::print("{}", TextTable(rows));
}

}  // namespace

void AddLs(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<LsArguments>();
  CLI::App* command = app.add_subcommand("ls", "List the episodes of a run, also while it is running.");
  command->add_option("RUN", arguments->run, "folder of a run")->required();
  command->add_flag("--json", arguments->json, "an array with one object per episode");
  command->add_flag("--failed", arguments->failed, "only episodes that failed (an error, not an unsuccessful attempt)");
  const auto rates = command->add_flag("--rates", arguments->rates, "success rates with 95 % intervals instead of episodes");
  const auto judge = command->add_option("--judge", arguments->judge, "whose verdicts the rates count: one judge's");
  judge->needs(rates)->capture_default_str();
  command->add_option("--world", arguments->world, "only this world's");
  command->add_option("--task", arguments->task, "only this task's");
  command->add_option("--policy", arguments->policy, "only this policy's, with all its checkpoints");
  command->footer(
      "Examples:\n"
      "  evac ls out/demo --world sim\n"
      "  evac ls out/demo --failed\n"
      "  evac ls out/demo --rates --task take_bottle\n"
      "  evac ls out/demo --json | jq '.[] | select(.verdicts.oracle == \"success\") | .video'");
  rates->excludes("--json", "--failed");
  command->callback([arguments, judge, &exit_code] {
    arguments->names_judge = judge->count() > 0;
    exit_code = ExitCode::kOk;
    if (arguments->rates) return PrintRates(*arguments);
    const Listing list = List(*arguments);
    if (arguments->json) {
      PrintJson(list.episodes);
    } else {
      PrintTable(list.episodes);
      PrintWire(list.wire);
    }
  });
}

}  // namespace evac
