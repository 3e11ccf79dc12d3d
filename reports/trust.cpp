#include "reports/trust.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/special.h"
#include "reports/wording.h"

namespace evac {
namespace {

using PolicyState = std::pair<std::string, std::string>;  // policy, state

/// One task's outcomes of one world, by policy and state, in order of seed.
using ByState = std::map<PolicyState, std::vector<TrialOutcome>>;

std::map<std::string, ByState> ByTask(const std::vector<TrialOutcome>& outcomes) {
  std::map<std::string, ByState> tasks;
  for (const TrialOutcome& outcome : outcomes) tasks[outcome.task][{outcome.policy, outcome.state}].push_back(outcome);
  for (auto& [task, states] : tasks) {
    for (auto& [key, trials] : states) std::ranges::stable_sort(trials, {}, &TrialOutcome::seed);
  }
  return tasks;
}

using PairsByState = std::map<PolicyState, std::vector<BothOutcomes>>;

/// One task's pairs by policy and state, and the outcomes that have no partner.
struct Paired {
  PairsByState pairs;
  std::map<std::string, std::int64_t> real_alone;               ///< by policy
  std::map<std::string, std::map<std::string, std::vector<bool>>> further;  ///< by policy and state
};

std::vector<BothOutcomes> PairsOf(const std::vector<TrialOutcome>& real, const std::vector<TrialOutcome>& model,
                                  bool seeds_agree) {
  std::vector<BothOutcomes> pairs;
  if (!seeds_agree) {
    for (std::size_t i = 0; i < std::min(real.size(), model.size()); ++i)
      pairs.push_back({real[i].success, model[i].success});
    return pairs;
  }
  for (const TrialOutcome& trial : real) {
    const auto partner = std::ranges::find(model, trial.seed, &TrialOutcome::seed);
    if (partner != model.end()) pairs.push_back({trial.success, partner->success});
  }
  return pairs;
}

Paired PairUp(const ByState& real, const ByState& model, bool seeds_agree) {
  Paired paired;
  for (const auto& [key, trials] : real) {
    const auto partner = model.find(key);
    std::vector<BothOutcomes> pairs;
    if (partner != model.end()) pairs = PairsOf(trials, partner->second, seeds_agree);
    paired.real_alone[key.first] += static_cast<std::int64_t>(trials.size() - pairs.size());
    if (!pairs.empty()) paired.pairs[key] = std::move(pairs);
  }
  for (const auto& [key, trials] : model) {
    if (real.contains(key)) continue;  // its further repeats are not independent of the pair's
    for (const TrialOutcome& trial : trials) paired.further[key.first][key.second].push_back(trial.success);
  }
  return paired;
}

std::vector<Count> CountsOf(const ByState& states, const std::string& policy) {
  std::vector<Count> counts;
  for (const auto& [key, trials] : states) {
    if (key.first != policy) continue;
    Count& count = counts.emplace_back();
    for (const TrialOutcome& trial : trials) {
      ++count.trials;
      count.successes += trial.success;
    }
  }
  return counts;
}

/// By initial state: policies that share one, and its repeats, are not independent.
std::map<std::string, BothWorlds> TablesOf(const PairsByState& pairs) {
  std::map<std::string, BothWorlds> tables;
  for (const auto& [key, of_state] : pairs) {
    const BothWorlds added = TableOf(of_state);
    BothWorlds& table = tables[key.second];
    table.both += added.both;
    table.only_real += added.only_real;
    table.only_model += added.only_model;
    table.neither += added.neither;
  }
  return tables;
}

/// The model as judge of what the robot would do.
ConfusionByState ConfusionsOf(const std::string& task, const std::map<std::string, BothWorlds>& tables) {
  ConfusionByState states;
  for (const auto& [state, table] : tables)
    states[{task, state}] = {.both_success = table.both,
                             .only_judge_success = table.only_model,
                             .only_human_success = table.only_real,
                             .both_failure = table.neither};
  return states;
}

/// model - real of each initial state.
std::vector<PairedOutcomes> DifferencesOf(const std::map<std::string, BothWorlds>& tables) {
  std::vector<PairedOutcomes> clusters;
  for (const auto& [state, table] : tables) clusters.push_back({{table.only_model, table.only_real}, table.n()});
  return clusters;
}

std::vector<bool> Flags(const Count& count) {
  std::vector<bool> flags(static_cast<std::size_t>(count.trials), false);
  std::fill_n(flags.begin(), count.successes, true);
  return flags;
}

/// The real rate from both worlds.
/// @param first_of_state  a pair of each initial state: bets are on pairs, not on counts of them
/// @param first_further   likewise, of states without a real trial
void Foretell(const PpiStates& states, const std::vector<BothOutcomes>& first_of_state, const Count& first_further,
              const TrustOptions& options, PredictedRate& rate) {
  const double confidence = options.confidence;
  std::vector<PairedOutcomes> clusters;
  for (const BothWorlds& table : states.paired) clusters.push_back({{table.only_model, table.only_real}, table.n()});
  rate.predicted = PpiMoverByState(states, confidence);
  rate.predicted.method = OnPairs(rate.predicted.method, PairsOfInterval(clusters, confidence));
  rate.tuned = PpiMeanByState(states, PpiWeight::kTuned, confidence);
  rate.betting =
      PpiBetting(first_of_state, Flags(first_further), {.confidence = confidence, .seed = options.bootstrap.seed});
  rate.betting.value = rate.tuned.value;
  if (rate.betting.n < rate.pairs.n()) rate.betting.method += ", one pair of each state";
}

PredictedRate Predict(const std::string& policy, const Paired& paired, const TrustOptions& options) {
  PredictedRate rate;
  rate.policy = policy;
  PpiStates states;
  std::vector<BothOutcomes> first_of_state;
  for (const auto& [key, of_state] : paired.pairs) {
    if (key.first != policy) continue;
    states.paired.push_back(TableOf(of_state));
    first_of_state.push_back(of_state.front());
  }
  Count first_further;
  if (const auto further = paired.further.find(policy); further != paired.further.end()) {
    for (const auto& [state, outcomes] : further->second) {
      states.more.push_back({std::ranges::count(outcomes, true), std::ssize(outcomes)});
      ++first_further.trials;
      first_further.successes += outcomes.front();
    }
  }
  rate.pairs = states.Paired();
  rate.further = states.More();
  if (const auto alone = paired.real_alone.find(policy); alone != paired.real_alone.end())
    rate.real_alone = alone->second;
  Foretell(states, first_of_state, first_further, options, rate);
  return rate;
}

/// The policies' rates over the pairs, with their states, for the bootstrap.
TaskPoints PointsOver(const std::vector<std::string>& policies, const Paired& paired) {
  std::set<std::string> states;
  for (const auto& [key, pairs] : paired.pairs) states.insert(key.second);
  TaskPoints task;
  for (const std::string& policy : policies) {
    PointOutcomes outcomes;
    CorrelationPoint point;
    point.policy = policy;
    point.real = point.sim = Count{};
    for (const std::string& state : states) {
      const auto of_state = paired.pairs.find({policy, state});
      const BothWorlds table = of_state == paired.pairs.end() ? BothWorlds{} : TableOf(of_state->second);
      outcomes.real.push_back({table.both + table.only_real, table.n()});
      outcomes.sim.push_back({table.both + table.only_model, table.n()});
      point.real->successes += outcomes.real.back().successes;
      point.sim->successes += outcomes.sim.back().successes;
      point.real->trials += table.n();
      point.sim->trials += table.n();
    }
    if (point.real->trials == 0) continue;
    point.real_sr = static_cast<double>(point.real->successes) / static_cast<double>(point.real->trials);
    point.sim_sr = static_cast<double>(point.sim->successes) / static_cast<double>(point.sim->trials);
    task.points.push_back(std::move(point));
    task.outcomes.points.push_back(std::move(outcomes));
  }
  return task;
}

void AddCorrelation(const TaskPoints& points, const TrustOptions& options, TaskTrust& task) {
  if (points.points.size() < kMinTrustPolicies) {
    task.correlation.n = std::ssize(points.points);
    const Undefined too_few{
        fmt::format("{} policies, and fewer than {} say nothing", points.points.size(), kMinTrustPolicies)};
    task.correlation.value = too_few;
    task.correlation.interval = too_few;
    task.correlation.method = "none";
    return;
  }
  BootstrapOptions bootstrap = options.bootstrap;
  bootstrap.confidence = options.confidence;
  const CorrelationGroup group = CorrelateOutcomes("", {points}, {.convention = {}, .bootstrap = bootstrap});
  task.correlation = group.pearson;
  task.undefined_replicates = group.undefined_replicates;
}

/// Rates over the pairs, each initial state a cluster.
void AddRates(const std::map<std::string, BothWorlds>& tables, double confidence, TaskTrust& task) {
  std::vector<Count> real, model, same;
  for (const auto& [state, table] : tables) {
    real.push_back({table.both + table.only_real, table.n()});
    model.push_back({table.both + table.only_model, table.n()});
    same.push_back({table.both + table.neither, table.n()});
  }
  task.real = ClusteredWilsonInterval(real, confidence);
  task.model = ClusteredWilsonInterval(model, confidence);
  task.same = ClusteredWilsonInterval(same, confidence);
}

/// model - real and its test, on the effective number of pairs.
void AddBias(const std::map<std::string, BothWorlds>& tables, double confidence, TaskTrust& task) {
  const std::vector<PairedOutcomes> states = DifferencesOf(tables);
  const Repeated pairs = PairsOfInterval(states, confidence);
  task.states = std::ssize(states);
  task.bias = TangoOfClusters(states, confidence);
  task.bias.method = OnPairs("Tango", pairs);
  task.effective_pairs = pairs.effective;
  const PairedOutcomes effective = EffectivePairs(states);
  task.test = McNemarExact(effective.flips);
  task.tested_pairs = effective.pairs;
}

/// All that it takes until the interval of a bias within the margin lies within it.
double PairsToTrust(const TaskTrust& task, double bias, const TrustOptions& options) {
  const double n = static_cast<double>(task.pairs.n()), effective = static_cast<double>(task.effective_pairs);
  const double distance = options.margin - std::abs(bias), z = TwoSidedZ(options.confidence);
  const double flips = static_cast<double>(task.pairs.discordant()) * effective / n;
  const double variance = (flips + 1) / (effective + 1) - bias * bias;
  const double by_flips = z * z * variance / (distance * distance) * n / effective;
  // Never surer than without any flip, where each state is one pair.
  const double by_states = z * z * (1 - options.margin) / options.margin * n / static_cast<double>(task.states);
  return std::max(by_flips, by_states);
}

/// All that it takes until the interval of a bias beyond the margin lies beyond it. Where all pairs flip one way they
/// show no variance: what the interval goes by is the one at the margin.
double PairsToDistrust(const TaskTrust& task, double bias, const TrustOptions& options) {
  const BothWorlds& pairs = task.pairs;
  const Number independent =
      PairsUntilTangoLeavesOut(std::copysign(options.margin, bias),
                               {{pairs.only_model, pairs.only_real}, pairs.n()}, options.confidence);
  return *independent * static_cast<double>(pairs.n()) / static_cast<double>(task.effective_pairs);
}

/// From how many pairs on the bias's interval would no longer reach the margin it is nearest to; a further pair is
/// taken to tell as much as those there are.
Defined<std::int64_t> MorePairs(const TaskTrust& task, const TrustOptions& options) {
  const BothWorlds& pairs = task.pairs;
  if (pairs.n() == 0) return Undefined{"no pair to plan from"};
  const double bias = static_cast<double>(pairs.only_model - pairs.only_real) / static_cast<double>(pairs.n());
  const double beyond = std::abs(bias) - options.margin;
  if (std::abs(beyond) < 0.005) return Undefined{"the bias seen is at the margin"};
  const double all = beyond < 0 ? PairsToTrust(task, bias, options) : PairsToDistrust(task, bias, options);
  const auto wanted = static_cast<std::int64_t>(std::ceil(all));
  if (wanted > kMostPairsAskedFor) {
    return Undefined{fmt::format("the bias seen is so near the margin that {} pairs would not do", kMostPairsAskedFor)};
  }
  return std::max<std::int64_t>(1, wanted - pairs.n());
}

void Decide(const TrustOptions& options, TaskTrust& task) {
  if (task.bias.value) {
    const auto [low, high] = *task.bias.interval;
    if (-options.margin <= low && high <= options.margin) task.trust = Trust::kYes;
    if (low > options.margin || high < -options.margin) task.trust = Trust::kNo;
  }
  if (task.trust == Trust::kUnknown) task.more = MorePairs(task, options);
}

TaskTrust TrustTask(const std::string& name, const ByState& real, const ByState& model, const TrustInput& input,
                    const TrustOptions& options) {
  const Paired paired = PairUp(real, model, input.seeds_agree);
  TaskTrust task;
  task.task = name;
  std::set<std::string> policies;
  for (const auto& [key, trials] : real) policies.insert(key.first);
  const std::map<std::string, BothWorlds> tables = TablesOf(paired.pairs);
  for (const auto& [state, table] : tables) {
    task.pairs.both += table.both;
    task.pairs.only_real += table.only_real;
    task.pairs.only_model += table.only_model;
    task.pairs.neither += table.neither;
  }
  AddRates(tables, options.confidence, task);
  AddBias(tables, options.confidence, task);
  task.agreement = StatisticsByState(ConfusionsOf(name, tables), options.confidence);
  for (const std::string& policy : policies) {
    PredictedRate& rate = task.policies.emplace_back(Predict(policy, paired, options));
    rate.real = ClusteredWilsonInterval(CountsOf(real, policy), options.confidence);
    rate.model = ClusteredWilsonInterval(CountsOf(model, policy), options.confidence);
  }
  AddCorrelation(PointsOver({policies.begin(), policies.end()}, paired), options, task);
  Decide(options, task);
  return task;
}

}  // namespace

const char* Name(Trust trust) {
  switch (trust) {
    case Trust::kYes:
      return "yes";
    case Trust::kNo:
      return "no";
    case Trust::kUnknown:
      return "unknown";
  }
  return "unknown";
}

std::vector<TaskTrust> TrustOf(const TrustInput& input, const TrustOptions& options) {
  if (!(options.margin > 0 && options.margin < 1)) {
    throw InvalidInput("trust: margin is {}, wanted 0 < margin < 1", options.margin);
  }
  TwoSidedZ(options.confidence);  // complains
  if (input.real.empty()) throw InvalidInput("trust: no real trial is a success or a failure");
  if (input.model.empty()) throw InvalidInput("trust: no imagined episode is judged a success or a failure");
  std::map<std::string, ByState> real = ByTask(input.real), model = ByTask(input.model);
  std::vector<TaskTrust> tasks;
  for (const auto& [task, states] : real) tasks.push_back(TrustTask(task, states, model[task], input, options));
  return tasks;
}

TrustInput TrustInputOf(const RunSummary& summary, const std::vector<RealTrial>& imported, const std::string& world) {
  TrustInput input;
  input.seeds_agree = imported.empty();
  if (imported.empty() && summary.reference.empty()) {
    throw InvalidInput("trust: the run has no real world and no imported trials (evac import-real)");
  }
  const auto is_it = [&](const WorldInfo& info) { return info.name == world && !info.is_real; };
  if (std::ranges::none_of(summary.data.worlds, is_it)) {
    throw InvalidInput("trust: '{}' is no world of the run beside the real one", world);
  }
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, in_world] = judged.episode.key;
    if (!judged.Counts() || (in_world != world && (!imported.empty() || in_world != summary.reference))) continue;
    (in_world == world ? input.model : input.real)
        .push_back({pair.task, PolicyLabel(pair.policy, pair.checkpoint), pair.initial_state, pair.seed,
                    judged.outcome == Outcome::kSuccess});
  }
  for (const RealTrial& trial : imported) {
    if (trial.outcome != Label::kSuccess && trial.outcome != Label::kFailure) continue;
    input.real.push_back({trial.task, PolicyLabel(trial.policy, trial.checkpoint), trial.initial_state,
                          static_cast<std::uint64_t>(trial.trial), trial.outcome == Label::kSuccess});
  }
  return input;
}

}  // namespace evac
