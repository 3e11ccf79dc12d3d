#include "reports/comparison.h"

#include <map>
#include <set>
#include <utility>

#include "core/statistics/rate_difference.h"
#include "core/statistics/rates.h"

namespace evac {
namespace {

using Indices = std::vector<std::size_t>;
using Cell = std::pair<std::string, std::string>;  // task, policy label

std::string LabelOf(const JudgedEpisode& judged) {
  return PolicyLabel(judged.episode.key.pair.policy, judged.episode.key.pair.checkpoint);
}

/// The episodes of one world, by (task, policy).
std::map<Cell, Indices> CellsOf(const std::vector<JudgedEpisode>& episodes, const std::string& world) {
  std::map<Cell, Indices> cells;
  for (std::size_t i = 0; i < episodes.size(); ++i) {
    const EpisodeKey& key = episodes[i].episode.key;
    if (key.world == world) cells[{key.pair.task, LabelOf(episodes[i])}].push_back(i);
  }
  return cells;
}

void CountPair(const JudgedEpisode& real, const JudgedEpisode& other, PairTable& table) {
  if (!real.Counts() || !other.Counts()) {
    ++table.uncounted;
    return;
  }
  const bool in_real = real.outcome == Outcome::kSuccess, in_other = other.outcome == Outcome::kSuccess;
  if (in_real && in_other) ++table.both_succeed;
  if (in_real && !in_other) ++table.real_only;
  if (!in_real && in_other) ++table.other_only;
  if (!in_real && !in_other) ++table.both_fail;
}

/// Agreements per initial state, over all tables given.
std::map<Cell, Count> AgreementsByState(const std::vector<JudgedEpisode>& episodes, const PairTable& table) {
  std::map<Cell, Count> states;
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = episodes[pair.real];
    const JudgedEpisode& other = episodes[pair.other];
    if (!real.Counts() || !other.Counts()) continue;
    Count& state = states[{table.task, real.episode.key.pair.initial_state}];
    ++state.trials;
    if (real.outcome == other.outcome) ++state.successes;
  }
  return states;
}

Estimate ClusteredRate(const std::map<Cell, Count>& clusters, double confidence) {
  std::vector<Count> counts;
  for (const auto& [state, count] : clusters) counts.push_back(count);
  return ClusteredWilsonInterval(counts, confidence);
}

/// The test of a table, on what its pairs tell as much as.
void Test(const std::vector<JudgedEpisode>& episodes, PairTable& table) {
  std::map<std::string, PairedOutcomes> states;
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = episodes[pair.real];
    const JudgedEpisode& other = episodes[pair.other];
    if (!real.Counts() || !other.Counts()) continue;
    PairedOutcomes& state = states[real.episode.key.pair.initial_state];
    ++state.pairs;
    if (real.outcome != other.outcome)
      ++(real.outcome == Outcome::kSuccess ? state.flips.only_first : state.flips.only_second);
  }
  std::vector<PairedOutcomes> clusters;
  for (const auto& [state, outcomes] : states) clusters.push_back(outcomes);
  const PairedOutcomes effective = EffectivePairs(clusters);
  table.effective_pairs = effective.pairs;
  table.test = McNemarExact(effective.flips);
}

PairTable TableOf(const std::vector<JudgedEpisode>& episodes, const Cell& cell, const Indices& real,
                  const Indices& other) {
  PairTable table;
  table.task = cell.first;
  table.policy = cell.second;
  std::map<PairKey, std::size_t> partners;
  for (const std::size_t i : other) partners.emplace(episodes[i].episode.key.pair, i);
  for (const std::size_t i : real) {
    const auto partner = partners.find(episodes[i].episode.key.pair);
    if (partner == partners.end()) {
      ++table.unpaired;
      continue;
    }
    table.pairs.push_back({i, partner->second});
    CountPair(episodes[i], episodes[partner->second], table);
    partners.erase(partner);
  }
  table.unpaired += static_cast<std::int64_t>(partners.size());
  Test(episodes, table);
  return table;
}

using StateCounts = std::map<std::string, std::pair<Count, Count>>;  // initial state → real, other

/// Successes and trials per initial state, over the pairs that count in both worlds.
StateCounts CountsByState(const std::vector<JudgedEpisode>& episodes, const PairTable& table) {
  StateCounts states;
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = episodes[pair.real];
    const JudgedEpisode& other = episodes[pair.other];
    if (!real.Counts() || !other.Counts()) continue;
    auto& [in_real, in_other] = states[real.episode.key.pair.initial_state];
    ++in_real.trials;
    ++in_other.trials;
    in_real.successes += real.outcome == Outcome::kSuccess;
    in_other.successes += other.outcome == Outcome::kSuccess;
  }
  return states;
}

std::vector<Count> Reals(const StateCounts& states) {
  std::vector<Count> counts;
  for (const auto& [state, count] : states) counts.push_back(count.first);
  return counts;
}

std::vector<Count> Others(const StateCounts& states) {
  std::vector<Count> counts;
  for (const auto& [state, count] : states) counts.push_back(count.second);
  return counts;
}

/// One task: each policy's counts, over the union of the states that any of them has.
struct TaskCounts {
  std::string task;
  std::vector<std::pair<std::string, StateCounts>> policies;
};

TaskPoints PointsOf(TaskCounts counts) {
  std::set<std::string> states;
  for (const auto& [policy, by_state] : counts.policies) {
    for (const auto& [state, count] : by_state) states.insert(state);
  }
  TaskPoints result;
  for (auto& [policy, by_state] : counts.policies) {
    for (const std::string& state : states) by_state[state];
    PointOutcomes& outcomes = result.outcomes.points.emplace_back(PointOutcomes{Reals(by_state), Others(by_state)});
    CorrelationPoint& point = result.points.emplace_back();
    point.task = counts.task;
    point.policy = policy;
    point.real = SumOf(outcomes.real);
    point.sim = SumOf(outcomes.sim);
    point.real_sr = static_cast<double>(point.real->successes) / static_cast<double>(point.real->trials);
    point.sim_sr = static_cast<double>(point.sim->successes) / static_cast<double>(point.sim->trials);
  }
  return result;
}

/// Fills in one task's tables and points; adds its agreements.
TaskCounts CompareTask(const std::vector<JudgedEpisode>& episodes, const std::string& task,
                       const ComparedWorlds& worlds, double confidence, WorldComparison& comparison) {
  std::map<Cell, Indices> real = CellsOf(episodes, worlds.real), other = CellsOf(episodes, worlds.other);
  TaskCounts counts{task, {}};
  for (const std::string& policy : worlds.policies) {
    const Cell cell{task, policy};
    if (real.count(cell) == 0 && other.count(cell) == 0) continue;
    PairTable& table = comparison.tables.emplace_back(TableOf(episodes, cell, real[cell], other[cell]));
    table.agreement = ClusteredRate(AgreementsByState(episodes, table), confidence);
    StateCounts by_state = CountsByState(episodes, table);
    if (by_state.empty()) continue;
    comparison.points.push_back({task, policy, PointLetter(comparison.points.size()),
                                 ClusteredWilsonInterval(Reals(by_state), confidence),
                                 ClusteredWilsonInterval(Others(by_state), confidence)});
    counts.policies.emplace_back(policy, std::move(by_state));
  }
  return counts;
}

Estimate OverallAgreement(const std::vector<JudgedEpisode>& episodes, const WorldComparison& comparison,
                          double confidence) {
  std::map<Cell, Count> states;
  for (const PairTable& table : comparison.tables) {
    for (const auto& [state, count] : AgreementsByState(episodes, table)) {
      states[state].successes += count.successes;
      states[state].trials += count.trials;
    }
  }
  return ClusteredRate(states, confidence);
}

}  // namespace

std::string PointLetter(std::size_t index) {
  std::string letter(1, static_cast<char>('a' + index % 26));
  return index < 26 ? letter : PointLetter(index / 26 - 1) + letter;
}

WorldComparison AsComparison(const CorrelationGroup& group) {
  WorldComparison comparison;
  comparison.real = "real";
  comparison.other = "sim";
  for (const CorrelationPoint& point : group.points) {
    const auto rate = [](double value) {
      Estimate estimate;
      estimate.value = value;
      estimate.interval = Undefined{"its counts are not known"};
      return estimate;
    };
    comparison.points.push_back({point.task, point.policy, PointLetter(comparison.points.size()), rate(point.real_sr),
                                 rate(point.sim_sr)});
  }
  comparison.correlation = group;
  return comparison;
}

Estimate RateOf(const std::vector<const JudgedEpisode*>& episodes, double confidence) {
  std::map<Cell, Count> states;
  for (const JudgedEpisode* judged : episodes) {
    if (!judged->Counts()) continue;
    Count& state = states[{judged->episode.key.pair.task, judged->episode.key.pair.initial_state}];
    ++state.trials;
    if (judged->outcome == Outcome::kSuccess) ++state.successes;
  }
  return ClusteredRate(states, confidence);
}

WorldComparison Compare(const std::vector<JudgedEpisode>& episodes, const ComparedWorlds& worlds,
                        const BootstrapOptions& bootstrap) {
  WorldComparison comparison;
  comparison.real = worlds.real;
  comparison.other = worlds.other;
  std::vector<TaskPoints> tasks;
  for (const std::string& task : worlds.tasks) {
    tasks.push_back(PointsOf(CompareTask(episodes, task, worlds, bootstrap.confidence, comparison)));
  }
  CorrelationOptions options;
  options.bootstrap = bootstrap;
  comparison.correlation = CorrelateOutcomes(worlds.other, tasks, options);
  for (std::size_t i = 0; tasks.size() > 1 && i < tasks.size(); ++i) {
    comparison.by_task.push_back(CorrelateOutcomes(worlds.tasks[i], {tasks[i]}, options));
  }
  for (TaskPoints& task : tasks) comparison.by_state.push_back(std::move(task.outcomes));
  comparison.agreement = OverallAgreement(episodes, comparison, bootstrap.confidence);
  return comparison;
}

}  // namespace evac
