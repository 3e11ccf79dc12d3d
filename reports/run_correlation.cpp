#include "reports/run_correlation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/error.h"
#include "reports/counted_judges.h"
#include "reports/outcome.h"

namespace evac {
namespace {

/// What the run holds, read once.
struct Counted {
  std::vector<WorldInfo> worlds;
  std::vector<std::string> tasks;
  std::vector<PolicyInfo> policies;
  std::map<EpisodeKey, bool> succeeded;  ///< only episodes that count
  std::set<EpisodeKey> there;            ///< all episodes
};

using VerdictsByEpisode = std::map<std::string, std::map<std::string, Verdict>>;

/// The full names of the judges that count. @throws InvalidInput if none of them gave a verdict.
std::string Judges(const std::string& wanted, const VerdictsByEpisode& verdicts, const std::string& run) {
  std::set<std::string> names;
  for (const auto& [episode, of_episode] : verdicts) {
    for (const auto& [judge, verdict] : of_episode) names.insert(judge);
  }
  const std::string full = FullJudgeNames(wanted, {names.begin(), names.end()});
  if (std::ranges::any_of(names, [&](const std::string& name) { return IsCounted(name, full); })) return full;
  if (names.empty()) throw NobodyJudged(run, wanted);
  throw InvalidInput("{}: judge {}: found verdicts of {}, wanted one of these", run, wanted, fmt::join(names, ", "));
}

Counted Read(const Store& store, const std::string& wanted) {
  Counted counted{store.Worlds(), {}, store.Policies(), {}, {}};
  for (const Task& task : store.Tasks()) counted.tasks.push_back(task.id);
  const VerdictsByEpisode verdicts = store.CurrentVerdicts();
  const std::string judges = Judges(wanted, verdicts, store.folder().string());
  for (const Episode& episode : store.Episodes()) {
    counted.there.insert(episode.key);
    const auto of_episode = verdicts.find(episode.key.Id());
    if (of_episode == verdicts.end()) continue;
    const Verdict* verdict = CountedVerdict(of_episode->second, judges);
    if (verdict == nullptr) continue;
    const Outcome outcome = OutcomeOf(episode, *verdict);
    if (outcome == Outcome::kSuccess || outcome == Outcome::kFailure)
      counted.succeeded[episode.key] = outcome == Outcome::kSuccess;
  }
  return counted;
}

std::string RealWorld(const Counted& counted, const std::string& run) {
  const auto real = std::ranges::find_if(counted.worlds, &WorldInfo::is_real);
  if (real == counted.worlds.end())
    throw InvalidInput("{}: worlds: found none that is real, wanted one to compare with", run);
  return real->name;
}

std::vector<std::string> OtherWorlds(const Counted& counted, const std::string& wanted, const std::string& run) {
  std::vector<std::string> others, chosen;
  for (const WorldInfo& world : counted.worlds) {
    if (!world.is_real) others.push_back(world.name);
  }
  for (const std::string& world : others) {
    if (wanted.empty() || world == wanted) chosen.push_back(world);
  }
  if (others.empty()) throw InvalidInput("{}: worlds: found only the real one, wanted another to compare with it", run);
  if (chosen.empty())
    throw InvalidInput("{}: world {}: found {} beside the real one, wanted one of these", run, wanted,
                       fmt::join(others, ", "));
  return chosen;
}

/// The pair keys of one (task, policy) in any world, in order.
std::set<PairKey> PairsOf(const Counted& counted, const std::string& task, const PolicyInfo& policy) {
  std::set<PairKey> pairs;
  for (const EpisodeKey& key : counted.there) {
    if (key.pair.task == task && key.pair.policy == policy.name && key.pair.checkpoint == policy.checkpoint)
      pairs.insert(key.pair);
  }
  return pairs;
}

/// The counts of one point by initial state, from pairs that count in both worlds.
using StateCounts = std::map<std::string, std::pair<Count, Count>>;  // state → real, other

StateCounts CountPairs(const Counted& counted, const std::set<PairKey>& pairs, const std::string& real,
                       const std::string& other) {
  StateCounts counts;
  for (const PairKey& pair : pairs) {
    const auto in_real = counted.succeeded.find({pair, real}), in_other = counted.succeeded.find({pair, other});
    if (in_real == counted.succeeded.end() || in_other == counted.succeeded.end()) continue;
    auto& [real_count, other_count] = counts[pair.initial_state];
    real_count.successes += in_real->second;
    other_count.successes += in_other->second;
    ++real_count.trials;
    ++other_count.trials;
  }
  return counts;
}

PointOutcomes ByState(const StateCounts& counts, const std::set<std::string>& states) {
  PointOutcomes outcomes;
  for (const std::string& state : states) {
    const auto found = counts.find(state);
    outcomes.real.push_back(found == counts.end() ? Count{} : found->second.first);
    outcomes.sim.push_back(found == counts.end() ? Count{} : found->second.second);
  }
  return outcomes;
}

CorrelationPoint PointOf(const std::string& task, const PolicyInfo& policy, const StateCounts& counts) {
  CorrelationPoint point;
  point.task = task;
  point.policy = PolicyLabel(policy.name, policy.checkpoint);
  Count real, sim;
  for (const auto& [state, count] : counts) {
    real.successes += count.first.successes;
    real.trials += count.first.trials;
    sim.successes += count.second.successes;
    sim.trials += count.second.trials;
  }
  point.real = real;
  point.sim = sim;
  if (real.trials == 0) return point;
  point.real_sr = static_cast<double>(real.successes) / static_cast<double>(real.trials);
  point.sim_sr = static_cast<double>(sim.successes) / static_cast<double>(sim.trials);
  return point;
}

struct TaskOfWorlds {
  TaskPoints task;
  std::vector<std::string> left_out;
};

TaskOfWorlds PointsOf(const Counted& counted, const std::string& task, const std::string& real,
                      const std::string& other) {
  TaskOfWorlds result;
  std::vector<StateCounts> counts;
  std::set<std::string> states;
  for (const PolicyInfo& policy : counted.policies) {
    const std::set<PairKey> pairs = PairsOf(counted, task, policy);
    if (pairs.empty()) continue;  // the suite does not run this policy on this task
    StateCounts of_point = CountPairs(counted, pairs, real, other);
    CorrelationPoint point = PointOf(task, policy, of_point);
    if (of_point.empty()) {
      result.left_out.push_back(
          fmt::format("{}, {}: no pair of episodes has a success or failure in both worlds", task, point.policy));
      continue;
    }
    for (const auto& [state, count] : of_point) states.insert(state);
    counts.push_back(std::move(of_point));
    result.task.points.push_back(std::move(point));
  }
  for (const StateCounts& of_point : counts) result.task.outcomes.points.push_back(ByState(of_point, states));
  return result;
}

CorrelationGroup GroupOf(const std::string& name, const std::vector<TaskOfWorlds>& tasks,
                         const CorrelationOptions& options) {
  std::vector<TaskPoints> points;
  std::vector<std::string> left_out;
  for (const TaskOfWorlds& task : tasks) {
    points.push_back(task.task);
    left_out.insert(left_out.end(), task.left_out.begin(), task.left_out.end());
  }
  CorrelationGroup group = CorrelateOutcomes(name, points, options);
  group.left_out = std::move(left_out);
  return group;
}

}  // namespace

std::vector<CorrelationGroup> CorrelateRun(const Store& store, const RunCorrelationOptions& options) {
  const std::string run = store.folder().string();
  const Counted counted = Read(store, options.judge);
  const std::string real = RealWorld(counted, run);
  std::vector<CorrelationGroup> groups;
  for (const std::string& other : OtherWorlds(counted, options.world, run)) {
    std::vector<TaskOfWorlds> tasks;
    for (const std::string& task : counted.tasks) tasks.push_back(PointsOf(counted, task, real, other));
    groups.push_back(GroupOf(other, tasks, options.correlation));
    if (tasks.size() < 2) continue;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      groups.push_back(GroupOf(other + "/" + counted.tasks[i], {tasks[i]}, options.correlation));
    }
  }
  return groups;
}

}  // namespace evac
