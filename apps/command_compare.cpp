#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/commands.h"
#include "apps/warnings.h"
#include "core/statistics/sequential.h"
#include "core/store.h"
#include "reports/counted_judges.h"
#include "reports/gate_baseline.h"
#include "reports/policy_comparison_output.h"
#include "reports/summary.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

struct CompareArguments {
  std::string first, second, run;
  std::string world, judge = "oracle";
  ComparisonOptions options;
  bool sequential = false, json = false;
};

/// A policy of a run: "visual_pick@good" of --run, "out/a:visual_pick@good", or a folder with one policy.
struct PolicyPlace {
  std::string run, policy;  ///< policy empty: the run's only one
};

PolicyPlace PlaceOf(const std::string& word, const std::string& default_run) {
  const auto is_folder = [](const std::string& name) { return std::filesystem::is_directory(name); };
  const std::size_t colon = word.rfind(':');
  if (colon != std::string::npos && is_folder(word.substr(0, colon))) {
    return {word.substr(0, colon), word.substr(colon + 1)};
  }
  if (default_run.empty() && is_folder(word)) return {word, ""};
  if (default_run.empty()) {
    throw InvalidInput("compare: '{}' is no folder, wanted RUN:POLICY, a RUN with one policy, or --run RUN beside it",
                       word);
  }
  return {default_run, word};
}

/// A run's episodes, judged.
struct JudgedRun {
  std::string folder;
  RunSummary summary;
};

/// Before whatever is made of them says so in its own words.
void Check(const ComparisonOptions& options) {
  const auto require = [](const char* option, double found) {
    if (!(found > 0 && found < 1)) throw InvalidInput("compare: --{} is {}, wanted between 0 and 1", option, found);
  };
  require("alpha", options.alpha);
  require("power", options.power);
}

JudgedRun Read(const std::string& folder, const CompareArguments& arguments) {
  SummaryOptions options;
  options.judge = arguments.judge;
  options.confidence = arguments.options.confidence();
  options.bootstrap_replicates = 1;  // no correlation is shown
  JudgedRun run{folder, Summarise(ReadRun(Store::Open(folder, Store::Mode::kReadOnly)), options)};
  const auto counts = [&](const std::string& judge) { return IsCounted(judge, run.summary.options.judge); };
  if (run.summary.judges.empty()) throw NobodyJudged(folder, arguments.judge);
  if (std::ranges::none_of(run.summary.judges, counts)) {
    throw InvalidInput("{}: no verdict of judge '{}', found: {}", folder, arguments.judge,
                       fmt::join(run.summary.judges, ", "));
  }
  return run;
}

std::string PolicyOf(const JudgedRun& run, const std::string& wanted) {
  const std::vector<std::string>& known = run.summary.policies;
  if (wanted.empty() && known.size() == 1) return known.front();
  if (!wanted.empty() && std::ranges::find(known, wanted) != known.end()) return wanted;
  throw InvalidInput("{}: {}, wanted one of: {}", run.folder,
                     wanted.empty() ? "holds several policies" : "has no policy '" + wanted + "'",
                     fmt::join(known, ", "));
}

ComparedPolicy Side(const JudgedRun& run, const std::string& policy, const std::string& world) {
  ComparedPolicy side{policy, {}};
  for (const JudgedEpisode& judged : run.summary.episodes) {
    const EpisodeKey& key = judged.episode.key;
    if (key.world == world && PolicyLabel(key.pair.policy, key.pair.checkpoint) == policy)
      side.episodes.push_back(judged);
  }
  return side;
}

/// Adds whose verdicts tell an outcome in `world`, single raters left out.
void AddTellers(const RunData& run, const std::string& world, std::set<std::string>& judges) {
  for (const Episode& episode : run.episodes) {
    const auto verdicts = run.verdicts.find(episode.key.Id());
    if (episode.key.world != world || verdicts == run.verdicts.end()) continue;
    for (const auto& [judge, verdict] : verdicts->second) {
      const bool tells = verdict.label == Label::kSuccess || verdict.label == Label::kFailure;
      if (tells && !judge.starts_with("human:")) judges.insert(judge);
    }
  }
}

/// Whom to ask where the judge who was asked told no outcome.
std::vector<std::string> OtherJudges(const JudgedRun& first, const JudgedRun& second, const ComparedWorld& compared) {
  const auto tells = [](const ComparisonRow& row) { return row.first_episodes + row.second_episodes > 0; };
  if (std::ranges::any_of(compared.comparison.tasks, tells)) return {};
  std::set<std::string> judges;
  for (const JudgedRun* run : {&first, &second}) AddTellers(run->summary.data, compared.world, judges);
  return {judges.begin(), judges.end()};
}

std::vector<std::string> WorldsOfBoth(const JudgedRun& first, const JudgedRun& second, const std::string& wanted) {
  std::set<std::string> names;
  std::vector<std::string> shared;
  for (const WorldInfo& world : first.summary.data.worlds) names.insert(world.name);
  for (const WorldInfo& world : second.summary.data.worlds) {
    if (names.contains(world.name) && (wanted.empty() || wanted == world.name)) shared.push_back(world.name);
  }
  if (shared.empty()) {
    throw InvalidInput("compare: {} has the worlds {}, which are not all in {}{}", first.folder, fmt::join(names, ", "),
                       second.folder, wanted.empty() ? "" : fmt::format(", or not '{}'", wanted));
  }
  return shared;
}

/// A run that is being written cannot take them; the bets stay valid without, they only forget.
void Keep(const std::vector<SequentialLook>& looks, const std::string& run) {
  try {
    Store::Open(run, Store::Mode::kReadWrite).AddLooks(looks);
  } catch (const Error& error) {
    fmt::print(stderr, "evac: warning: this look was not kept: {}\n", error.what());
  }
}

/// What a look is kept under, in the first one's run. What was seen against one run is no evidence against another, so
/// it names that one, by suite and folder: one suite is run more than once. Judges by their full names, of both runs
/// where they differ.
std::string NameOfLooks(const ComparedWorld& compared, const JudgedRun& first, const JudgedRun& second) {
  const PolicyComparison& comparison = compared.comparison;
  const std::string &judge = first.summary.options.judge, &other_judge = second.summary.options.judge;
  std::string other_run;
  if (!std::filesystem::equivalent(first.folder, second.folder)) {
    other_run = fmt::format(" of {:.16} at {}", second.summary.data.run.suite_hash,
                            std::filesystem::canonical(second.folder).string());
  }
  return fmt::format("{} against {}{} in {}, judge {}{}", comparison.first, comparison.second, other_run,
                     compared.world, judge, other_judge == judge ? "" : " and " + other_judge);
}

/// What can be bet on: pairs, however few of the episodes have a partner yet. A task without one waits.
std::vector<ComparisonRow> RowsWithPairs(const PolicyComparison& comparison) {
  std::vector<ComparisonRow> rows = comparison.tasks;
  if (rows.size() > 1) rows.push_back(comparison.all);
  std::erase_if(rows, [](const ComparisonRow& row) { return row.shared == 0; });
  return rows;
}

/// Before a look is kept of any world. One that only one of the two has begun waits, if there are pairs in another.
void DemandPairs(const std::vector<ComparedWorld>& worlds) {
  for (const ComparedWorld& compared : worlds) {
    const ComparisonRow& all = compared.comparison.all;
    if (all.shared == 0 && all.first_episodes > 0 && all.second_episodes > 0)
      throw InvalidInput("compare: --sequential bets on pairs, but in {} none of {} and {} episodes have one",
                         compared.world, all.first_episodes, all.second_episodes);
  }
  if (std::ranges::all_of(worlds, [](const auto& compared) { return RowsWithPairs(compared.comparison).empty(); }))
    throw InvalidInput("compare: --sequential bets on pairs, but {} and {} have none that counts yet",
                       worlds.front().comparison.first, worlds.front().comparison.second);
}

/// This look's bets, and what was kept under `name` of the looks before in `run`; only what has changed since is a new
/// look.
std::vector<BetState> Bet(const PolicyComparison& comparison, const std::string& name, const std::string& run) {
  const std::vector<SequentialLook> before = Store::Open(run, Store::Mode::kReadOnly).Looks();
  std::vector<SequentialLook> added;
  std::vector<BetState> bets;
  for (const ComparisonRow& row : RowsWithPairs(comparison)) {
    BetState bet{row.task, row.shared, row.flips, FlipsEValue(row.flips.only_first, row.flips.only_second), 1, 0};
    SequentialLook look{name, row.task, row.shared, row.flips.only_first, row.flips.only_second, bet.e_value};
    bool is_new = true;
    for (const SequentialLook& old : before) {
      if (old.comparison != look.comparison || old.task != look.task) continue;
      bet.largest = std::max(bet.largest, old.e_value);
      ++bet.looks;
      is_new = old != look;  // against the last of them
    }
    bet.largest = std::max(bet.largest, bet.e_value);
    bet.looks += is_new;
    if (is_new) added.push_back(std::move(look));
    bets.push_back(std::move(bet));
  }
  if (!added.empty()) Keep(added, run);
  return bets;
}

using TextByName = std::map<std::string, std::string>;

/// Of what both know: a run of an earlier evac lacks some.
bool IsAnother(const std::string& name, const TextByName& first, const TextByName& second) {
  const auto one = first.find(name), two = second.find(name);
  return one != first.end() && two != second.end() && one->second != two->second;
}

/// What gates would refuse: tasks, worlds and settings of one name that are not the same in both runs.
std::vector<std::string> Changes(const JudgedRun& first, const JudgedRun& second,
                                 const std::vector<ComparedWorld>& compared) {
  const PinnedResult a = Pin(first.summary, first.folder), b = Pin(second.summary, second.folder);
  std::set<std::string> tasks;  // with episodes of both
  std::vector<std::pair<std::string, const char*>> found;
  for (const ComparedWorld& one : compared) {
    if (IsAnother(one.world, a.worlds, b.worlds)) found.emplace_back("the profile of world " + one.world, "world's");
    for (const ComparisonRow& row : one.comparison.tasks) {
      if (row.first_episodes > 0 && row.second_episodes > 0) tasks.insert(row.task);
    }
  }
  for (const std::string& task : tasks) {
    if (IsAnother(task, a.tasks, b.tasks)) {
      found.emplace_back("the page of task " + task, "task's");
    } else if (IsAnother(task, a.scenes, b.scenes)) {
      found.emplace_back("a file that the page of task " + task + " names", "task's");
    } else if (IsAnother(task, a.definitions, b.definitions)) {
      found.emplace_back("one of the cameras, stop rule and limits of task " + task, "task's");
    }
  }
  for (const auto& [name, value] : a.settings) {
    if (IsAnother(name, a.settings, b.settings)) found.emplace_back("the suite's " + name, "suite's");
  }
  std::vector<std::string> changes;
  for (const auto& [what, whose] : found)
    changes.push_back(fmt::format("{} is another in {} than in {}: what the policies differ by may be the {}", what,
                                  first.folder, second.folder, whose));
  return changes;
}

void Compare(const CompareArguments& arguments) {
  Check(arguments.options);
  const PolicyPlace first = PlaceOf(arguments.first, arguments.run), second = PlaceOf(arguments.second, arguments.run);
  if (!arguments.run.empty() && first.run != arguments.run && second.run != arguments.run)
    throw InvalidInput("--run: found {}, but both policies name runs of their own: {} and {}", arguments.run, first.run,
                       second.run);
  const JudgedRun one = Read(first.run, arguments), two = Read(second.run, arguments);
  const std::string a = PolicyOf(one, first.policy), b = PolicyOf(two, second.policy);
  const bool same_run = std::filesystem::equivalent(first.run, second.run);
  if (same_run && a == b) throw InvalidInput("compare: {} against itself", a);
  const bool are_two_judges = one.summary.options.judge != two.summary.options.judge;
  std::vector<ComparedWorld> worlds;
  std::vector<std::string> not_begun;
  for (const std::string& world : WorldsOfBoth(one, two, arguments.world)) {
    ComparedPolicy left = Side(one, a, world), right = Side(two, b, world);
    if (a == b) {
      left.name = first.run + ":" + a;
      right.name = second.run + ":" + b;
    }
    if (left.episodes.empty() && right.episodes.empty()) {
      not_begun.push_back(world);
      continue;
    }
    ComparedWorld& compared = worlds.emplace_back(
        ComparedWorld{world, one.summary.options.judge, ComparePolicies(left, right, arguments.options), {}});
    if (are_two_judges) compared.second_judge = two.summary.options.judge;
    compared.other_judges = OtherJudges(one, two, compared);
  }
  if (worlds.empty())
    throw InvalidInput("compare: neither {} of {} nor {} of {} has an episode in {}", a, first.run, b, second.run,
                       fmt::join(not_begun, ", "));
  if (!not_begun.empty())
    fmt::print(stderr, "evac: note: left out, as neither policy has an episode there yet: {}\n",
               fmt::join(not_begun, ", "));
  if (arguments.sequential) DemandPairs(worlds);
  if (are_two_judges)
    PrintWarnings({fmt::format("{} is judged by {} and {} by {}: what they differ by may be the judges', not the "
                               "policies'; name one that judged both",
                               first.run, one.summary.options.judge, second.run, two.summary.options.judge)});
  if (!same_run) PrintWarnings(Changes(one, two, worlds));
  Json all = {{"schema", 1}, {"worlds", Json::array()}};
  for (ComparedWorld& compared : worlds) {
    if (arguments.sequential) compared.bets = Bet(compared.comparison, NameOfLooks(compared, one, two), first.run);
    if (!arguments.json) fmt::print("{}{}", all["worlds"].empty() ? "" : "\n", ComparisonText(compared));
    all["worlds"].push_back(ComparisonJson(compared));
  }
  if (arguments.json) fmt::print("{}\n", all.dump(2, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

void AddCompare(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<CompareArguments>();
  CLI::App* command = app.add_subcommand("compare", "Say which of two policies is better, and how sure.");
  command
      ->add_option("A", arguments->first, "POLICY@CHECKPOINT of --run, RUN:POLICY@CHECKPOINT, or a RUN with one policy")
      ->required();
  command->add_option("B", arguments->second, "the same; the baseline")->required();
  command->add_option("--run", arguments->run, "the run that both are in")->type_name("RUN");
  command->add_option("--world", arguments->world, "only in this world; else in every world of both")
      ->type_name("NAME");
  command
      ->add_option("--judge", arguments->judge,
                   "whose verdicts are counted; with commas, of each episode the first who can tell: oracle,classifier")
      ->capture_default_str();
  command->add_option("--alpha", arguments->options.alpha, "risk of a false decision, two-sided")
      ->capture_default_str();
  command->add_option("--power", arguments->options.power, "that 'how many more' promises")->capture_default_str();
  command->add_flag("--sequential", arguments->sequential,
                    "also a bet that stays valid however often one looks; keeps its e-values in A's run");
  command->add_flag("--json", arguments->json, "for programs: docs/compare.md");
  command->footer(
      "Examples:\n"
      "  evac compare visual_pick@good visual_pick@poor --run out/demo\n"
      "  evac compare out/candidate out/baseline --world sim --json\n"
      "  evac compare out/a:visual_pick@good out/b:visual_pick@good --sequential\n"
      "Paired by initial state and seed where 80 % are shared. Not decided is no error: the exit code is 0.");
  command->callback([arguments, &exit_code] {
    Compare(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
