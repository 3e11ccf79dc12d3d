#include "reports/summary.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "core/config.h"
#include "core/error.h"
#include "reports/counted_judges.h"
#include "reports/letters.h"

namespace evac {
namespace {

std::vector<JudgedEpisode> Judged(const RunData& data, const std::string& judge) {
  std::vector<JudgedEpisode> judged;
  for (const Episode& episode : data.episodes) {
    std::optional<Verdict> verdict;
    if (const auto all = data.verdicts.find(episode.key.Id()); all != data.verdicts.end()) {
      if (const Verdict* counted = CountedVerdict(all->second, judge)) verdict = *counted;
    }
    const Outcome outcome = OutcomeOf(episode, verdict);
    judged.push_back({episode, outcome, std::move(verdict)});
  }
  return judged;
}

std::vector<std::string> JudgesOf(const RunData& data) {
  std::set<std::string> names;
  for (const auto& [episode, verdicts] : data.verdicts) {
    for (const auto& [judge, verdict] : verdicts) names.insert(judge);
  }
  return {names.begin(), names.end()};
}

/// Stores list policies by name; a suite names them in an order that means something (oldest first, say). Those that it
/// does not name come last. A suite that cannot be read changes nothing.
void OrderAsInSuite(RunData& data) try {
  std::map<std::pair<std::string, std::string>, std::size_t> places;
  for (const Config& policy : Config::FromText(data.run.suite_text, "suite").List("policies")) {
    const auto checkpoint = policy.Get<std::string>("checkpoint", kDefaultCheckpoint);
    places.try_emplace({policy.Get<std::string>("name", ""), checkpoint}, places.size());
  }
  const auto place = [&places](const PolicyInfo& policy) {
    const auto found = places.find({policy.name, policy.checkpoint});
    return found == places.end() ? places.size() : found->second;
  };
  std::ranges::stable_sort(data.policies, {}, place);
} catch (const Error&) {
}

/// In the order declared; a policy that was never declared comes last.
std::vector<std::string> PoliciesOf(const RunData& data) {
  std::vector<std::string> labels;
  const auto add = [&labels](const std::string& label) {
    if (std::find(labels.begin(), labels.end(), label) == labels.end()) labels.push_back(label);
  };
  for (const PolicyInfo& policy : data.policies) add(PolicyLabel(policy.name, policy.checkpoint));
  for (const Episode& episode : data.episodes) add(PolicyLabel(episode.key.pair.policy, episode.key.pair.checkpoint));
  return labels;
}

std::vector<std::string> TasksOf(const RunData& data) {
  std::vector<std::string> ids;
  for (const Task& task : data.tasks) ids.push_back(task.id);
  return ids;
}

using Members = std::vector<const JudgedEpisode*>;
using CellPlace = std::tuple<std::string, std::string, std::string>;  // task, policy, world

/// Every episode once, by its cell.
std::map<CellPlace, Members> MembersOf(const std::vector<JudgedEpisode>& episodes) {
  std::map<CellPlace, Members> cells;
  for (const JudgedEpisode& judged : episodes) {
    const EpisodeKey& key = judged.episode.key;
    cells[{key.pair.task, PolicyLabel(key.pair.policy, key.pair.checkpoint), key.world}].push_back(&judged);
  }
  return cells;
}

void CountEpisodes(const Members& members, double confidence, RateCell& cell) {
  std::set<std::string> states;
  for (const JudgedEpisode* judged : members) {
    ++cell.counts[static_cast<std::size_t>(judged->outcome)];
    if (judged->Counts()) states.insert(judged->episode.key.pair.initial_state);
  }
  cell.states = static_cast<std::int64_t>(states.size());
  if (!members.empty()) cell.rate = RateOf(members, confidence);
}

/// In the orders that the summary has, of these episodes.
std::vector<RateCell> AllCells(const RunSummary& summary, const std::vector<JudgedEpisode>& episodes) {
  std::vector<RateCell> rates;
  std::map<CellPlace, Members> members = MembersOf(episodes);
  for (const Task& task : summary.data.tasks) {
    for (const std::string& policy : summary.policies) {
      for (const WorldInfo& world : summary.data.worlds) {
        RateCell cell;
        cell.task = task.id;
        cell.policy = policy;
        cell.world = world.name;
        CountEpisodes(members[{task.id, policy, world.name}], summary.options.confidence, cell);
        if (cell.Apart() + cell.Of(Outcome::kSuccess) + cell.Of(Outcome::kFailure) > 0)
          rates.push_back(std::move(cell));
      }
    }
  }
  return rates;
}

std::vector<WorldComparison> ComparisonsOf(const RunSummary& summary) {
  std::vector<WorldComparison> comparisons;
  if (summary.reference.empty()) return comparisons;
  const SummaryOptions& options = summary.options;
  for (const WorldInfo& world : summary.data.worlds) {
    if (world.is_real) continue;
    comparisons.push_back(Compare(summary.episodes,
                                  {summary.reference, world.name, TasksOf(summary.data), summary.policies},
                                  {options.bootstrap_replicates, options.bootstrap_seed, options.confidence}));
  }
  return comparisons;
}

}  // namespace

RunData ReadRun(const Store& store) {
  return {store.run(),
          store.Tasks(),
          store.Worlds(),
          store.Policies(),
          store.Episodes(),
          store.CurrentVerdicts(),
          store.CountersByPolicy(),
          store.RealTrials(),
          store.GateRecords(),
          TotalsOfCalls(store.folder()),
          store.Plan(),
          store.PageHashes()};
}

std::int64_t RateCell::Apart() const {
  return Of(Outcome::kCannotTell) + Of(Outcome::kInvalid) + Of(Outcome::kError) + Of(Outcome::kUnjudged);
}

std::int64_t RunSummary::Count(Outcome outcome) const {
  return std::count_if(episodes.begin(), episodes.end(),
                       [outcome](const JudgedEpisode& judged) { return judged.outcome == outcome; });
}

RunSummary Summarise(RunData data, const SummaryOptions& options) {
  if (!(options.confidence > 0 && options.confidence < 1))
    throw InvalidInput("confidence is {}, wanted a number between 0 and 1", options.confidence);
  if (options.bootstrap_replicates < 1)
    throw InvalidInput("bootstrap replicates are {}, wanted 1 or more", options.bootstrap_replicates);
  OrderAsInSuite(data);
  RunSummary summary;
  summary.options = options;
  summary.judges = JudgesOf(data);
  summary.options.judge = FullJudgeNames(options.judge, summary.judges);
  summary.episodes = Judged(data, summary.options.judge);
  summary.policies = PoliciesOf(data);
  for (const WorldInfo& world : data.worlds) {
    if (world.is_real && summary.reference.empty()) summary.reference = world.name;
  }
  summary.data = std::move(data);
  summary.rates = AllCells(summary, summary.episodes);
  summary.comparisons = ComparisonsOf(summary);
  return summary;
}

std::string CountedWithSmall(const RunSummary& summary) {
  const std::string small = LastJudge(summary.options.judge) + ":small";
  const auto is_missed = [&](const JudgedEpisode& judged) {
    const auto verdicts = summary.data.verdicts.find(judged.episode.key.Id());
    return judged.outcome == Outcome::kUnjudged && verdicts != summary.data.verdicts.end() &&
           verdicts->second.contains(small);
  };
  return std::ranges::any_of(summary.episodes, is_missed) ? summary.options.judge + "," + small : "";
}

std::vector<JudgeRates> RatesOfOtherJudges(const RunSummary& summary) {
  std::vector<JudgeRates> others;
  for (const std::string& judge : summary.judges) {
    if (IsCounted(judge, summary.options.judge) || judge.starts_with("human:")) continue;
    const std::vector<JudgedEpisode> episodes = Judged(summary.data, judge);
    JudgeRates& other = others.emplace_back(JudgeRates{judge, AllCells(summary, episodes)});
    GiveLetters(episodes, 1 - summary.options.confidence, other.rates);
  }
  return others;
}

}  // namespace evac
