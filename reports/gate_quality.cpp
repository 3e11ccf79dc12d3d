#include "reports/gate_quality.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/statistics/confusion.h"
#include "core/statistics/inverted_interval.h"
#include "core/statistics/special.h"
#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kPower = 0.8;
constexpr double kTooNear = 1e-3;  // a value at the threshold itself is decided by no number of episodes

/// A number with its interval at any confidence, held against one threshold.
struct Held {
  Estimate value;  ///< interval at the rule's own confidence
  IntervalAt interval;
  double threshold = 0;
  bool is_ceiling = false;  ///< good is below
  const char* unit = "episodes";
  double least_p = 0;  ///< less cannot be shown, however far the interval is
  std::optional<std::int64_t> units = {};  ///< how many of `unit` the interval rests on; none: as many as the value
};

/// From how many on the interval would clear the threshold with power, if the value stays.
std::string MoreOf(const Held& held, double alpha) {
  const std::int64_t units = held.units.value_or(held.value.n);
  if (!held.value.value || !held.value.interval || units == 0) return "";
  const double value = *held.value.value, distance = std::abs(value - held.threshold);
  if (distance < kTooNear) return "The value is at the threshold: no number of episodes decides.";
  const bool is_good = held.is_ceiling ? value < held.threshold : value > held.threshold;
  const double width =
      is_good == held.is_ceiling ? held.value.interval->high - value : value - held.value.interval->low;
  const double ratio = width / distance * (1 + NormalQuantile(kPower) / NormalQuantile(1 - alpha));
  const double more = std::ceil(static_cast<double>(units) * (ratio * ratio - 1));
  return fmt::format("If the value stays as seen: about {} more {}.", std::max(1.0, more), held.unit);
}

void Hold(const GateRule& rule, const Held& held, Evidence& evidence) {
  RuleDecision& decision = evidence.decision;
  decision.value = held.value;
  evidence.good = fmt::format("{} {:g}", held.is_ceiling ? "at most" : "at least", held.threshold);
  evidence.bad = fmt::format("{} {:g}", held.is_ceiling ? "above" : "below", held.threshold);
  if (!held.value.value) {
    decision.p = Undefined{held.value.value.reason()};
  } else {
    const double p = held.is_ceiling ? PAbove(held.interval, held.threshold) : PBelow(held.interval, held.threshold);
    decision.p = std::max(p, held.least_p);
  }
  const Defined<Interval>& interval = held.value.interval;
  evidence.shows_good = held.value.value && interval &&
                        (held.is_ceiling ? interval->high <= held.threshold : interval->low >= held.threshold);
  evidence.more = MoreOf(held, rule.alpha);
}

void HoldRate(const GateRule& rule, const GateSides& sides, Evidence& evidence) {
  const std::vector<Count> states = CountsOf(sides.candidate);
  const bool has_repeats = std::ranges::any_of(states, [](const Count& count) { return count.trials > 1; });
  std::int64_t successes = 0, trials = 0;
  for (const Count& count : states) {
    successes += count.successes;
    trials += count.trials;
  }
  const auto estimate = [=](double confidence) {
    return has_repeats ? RateOfStates(states, confidence) : ClopperPearsonInterval(successes, trials, confidence);
  };
  evidence.decision.states = trials;
  evidence.initial_states = std::ssize(states);
  Hold(rule, {estimate(1 - 2 * rule.alpha), [=](double c) { return estimate(c).interval; }, *rule.at_least}, evidence);
  evidence.decision.statement =
      fmt::format("{} {} ({:g} %, {}), {}/{}", evidence.decision.policy, PercentWithInterval(evidence.decision.value),
                  100 * (1 - 2 * rule.alpha), evidence.decision.value.method, successes, trials);
}

const WorldComparison& ComparisonWith(const RunSummary& run, const std::string& world, const std::string& rule) {
  const auto found = std::ranges::find(run.comparisons, world, &WorldComparison::other);
  if (found != run.comparisons.end()) return *found;
  std::vector<std::string> known;
  for (const WorldComparison& comparison : run.comparisons) known.push_back(comparison.other);
  throw InvalidInput("gate rule '{}': world: found '{}', wanted one beside the real one: {}", rule, world,
                     fmt::join(known, ", "));
}

const Defined<BootstrapOf>& Resampled(const PairedBootstrap& bootstrap, const std::string& metric) {
  return metric == "pearson" ? bootstrap.pearson : metric == "spearman" ? bootstrap.spearman : bootstrap.mmrv;
}

/// What a rule's correlation is over: all tasks, or the one that it names.
struct PointsOfRule {
  const CorrelationGroup& group;
  std::vector<TaskOutcomes> by_state;  ///< what it is resampled from
};
PointsOfRule PointsOf(const GateRule& rule, const WorldComparison& comparison) {
  const auto task = std::ranges::find(comparison.by_task, rule.task, &CorrelationGroup::group);
  if (task == comparison.by_task.end()) return {comparison.correlation, comparison.by_state};  // of the run's only one
  return {*task, {comparison.by_state.at(static_cast<std::size_t>(task - comparison.by_task.begin()))}};
}

/// Of each task those that any of its policies tried in both worlds.
std::int64_t InitialStatesOf(const std::vector<TaskOutcomes>& tasks) {
  std::int64_t count = 0;
  for (const TaskOutcomes& task : tasks) count += task.points.empty() ? 0 : std::ssize(task.points.front().real);
  return count;
}

void HoldCorrelation(const GateRule& rule, const RunSummary& run, const GateSides& sides, Evidence& evidence) {
  const WorldComparison& comparison = ComparisonWith(run, sides.world, rule.name);
  const auto [group, by_state] = PointsOf(rule, comparison);
  Held held{rule.metric == "pearson"    ? group.pearson
            : rule.metric == "spearman" ? group.spearman
                                        : group.mmrv,
            [](double) -> Defined<Interval> { return Undefined{"not resampled"}; },
            rule.at_most.value_or(rule.at_least.value_or(0)), rule.metric == "mmrv", "initial states"};
  held.units = evidence.initial_states = InitialStatesOf(by_state);  // what is resampled
  std::string dropped;
  if (held.value.value) {  // the same draws as the report's, at the confidence that is asked
    const PairedBootstrap bootstrap = PairedStateBootstrap(by_state, group.options.convention, group.options.bootstrap);
    if (const auto& resampled = Resampled(bootstrap, rule.metric)) {
      held.interval = resampled->of_record;
      held.least_p = 1 / (1 + static_cast<double>(resampled->resampled.replicates.size()));
      if (resampled->undefined > 0)
        dropped = fmt::format(", {} of {} replicates had none and were dropped", resampled->undefined,
                              group.options.bootstrap.replicates);
    } else {
      held.interval = [reason = resampled.reason()](double) -> Defined<Interval> { return Undefined{reason}; };
    }
  }
  held.value.confidence = 1 - 2 * rule.alpha;
  held.value.interval = held.interval(held.value.confidence);
  if (!held.value.interval) dropped.clear();  // its reason says it
  RuleDecision& decision = evidence.decision;
  for (const PairTable& table : comparison.tables) {
    if (rule.task.empty() || table.task == rule.task) decision.states += table.Counted();
  }
  Hold(rule, held, evidence);
  evidence.more = held.value.value ? evidence.more : "";
  decision.statement = fmt::format("{} of {} against {}{}: {} ({:g} %) over {}, {}{}", rule.metric, sides.world,
                                   run.reference, rule.task.empty() ? "" : " on " + rule.task,
                                   NumberWithInterval(held.value), 100 * held.value.confidence,
                                   Counted(held.value.n, "point"), Counted(decision.states, "pair"), dropped);
}

/// Of a judge that never differed from the other, whose kappa shows no spread. It may differ in a share of the states
/// all the same: in none of G it then does with the chance tail = (1 - share)^G, as docs/decisions/0012 has it.
struct Unerring {
  double share_to_kappa = 0;  ///< 1 / (1 - chance): two for outcomes that are as many
  double states = 0;

  Interval At(double confidence) const {
    const double share = 1 - std::pow((1 - confidence) / 2, 1 / states);
    return {std::max(-1.0, 1 - share_to_kappa * share), 1};
  }
  /// From how many states on the low end reaches `threshold`, one-sided at alpha; 0: no number is enough.
  double StatesFor(double threshold, double alpha) const {
    const double share = (1 - threshold) / share_to_kappa;
    return share > 0 && share < 1 ? std::ceil(std::log(alpha) / std::log1p(-share)) : 0;
  }
};

void HoldUnerringKappa(const GateRule& rule, const Unerring& judge, Estimate kappa, Evidence& evidence) {
  kappa.confidence = 1 - 2 * rule.alpha;
  kappa.interval = judge.At(kappa.confidence);
  kappa.method = "no state of all differs";
  Hold(rule, {kappa, [=](double c) { return Defined<Interval>(judge.At(c)); }, *rule.at_least}, evidence);
  const double wanted = judge.StatesFor(*rule.at_least, rule.alpha);
  evidence.more = fmt::format("The two never differed, but in {} only: ",
                              Counted(static_cast<std::int64_t>(judge.states), "initial state")) +
                  (wanted > 0 ? fmt::format("{:.0f} of which none differs would show it.", wanted)
                              : "no number of them would show it.");
}

/// The other judge by its full name, of which the rule may say a part as of every judge.
std::string JudgeAgainst(const GateRule& rule, const RunSummary& run) {
  std::string full;
  try {
    full = FullJudgeNames(rule.against, run.judges);
  } catch (const Error& error) {
    throw InvalidInput("gate rule '{}': against: {}", rule.name, error.what());
  }
  if (std::ranges::find(run.judges, full) == run.judges.end())
    throw InvalidInput("gate rule '{}': against: found '{}', wanted a judge of the run: {}", rule.name, rule.against,
                       fmt::join(run.judges, ", "));
  if (IsCounted(full, run.options.judge))
    throw InvalidInput("gate rule '{}': against: found '{}', wanted another than the rules' own judge, {}", rule.name,
                       full, run.options.judge);
  return full;
}

void HoldKappa(const GateRule& rule, const RunSummary& run, const GateSides& sides, Evidence& evidence) {
  const std::string against = JudgeAgainst(rule, run);
  ConfusionByState states;
  for (const JudgedEpisode& judged : run.episodes) {
    const EpisodeKey& key = judged.episode.key;
    if (key.world != sides.world || (!rule.task.empty() && key.pair.task != rule.task) || !judged.Counts()) continue;
    if (!rule.policy.empty() && PolicyLabel(key.pair.policy, key.pair.checkpoint) != rule.policy) continue;
    const auto verdicts = run.data.verdicts.find(key.Id());
    const auto other = verdicts->second.find(against);
    if (other == verdicts->second.end()) continue;
    const Label label = other->second.label;
    if (label != Label::kSuccess && label != Label::kFailure) continue;
    states[{key.pair.task, key.pair.initial_state}].Add(judged.outcome == Outcome::kSuccess, label == Label::kSuccess);
  }
  const Confusion table = SumOf(states);
  const auto kappa = [&](double confidence) { return StatisticsByState(states, confidence).kappa; };
  const Estimate seen = kappa(1 - 2 * rule.alpha);
  if (seen.value && !seen.interval && table.only_judge_success + table.only_human_success == 0) {
    const double chance = *StatisticsOf(table).chance;
    HoldUnerringKappa(rule, {1 / (1 - chance), static_cast<double>(states.size())}, seen, evidence);
  } else {
    Hold(rule, {seen, [=](double c) { return kappa(c).interval; }, *rule.at_least}, evidence);
  }
  RuleDecision& decision = evidence.decision;
  decision.states = evidence.initial_states = std::ssize(states);
  decision.statement = fmt::format(
      "kappa of {} with {} in {}{}: {} ({:g} %) over {} of {} that both judged, {} only {} and {} only {} a "
      "success",
      run.options.judge, against, sides.world, rule.policy.empty() ? "" : " on the clips of " + rule.policy,
      NumberWithInterval(decision.value), 100 * (1 - 2 * rule.alpha),
      Counted(table.total(), "episode"), Counted(decision.states, "initial state"), table.only_judge_success, run.options.judge, table.only_human_success,
      against);
}

/// Each (task, initial state) once that was tried, whatever became of it.
std::int64_t StatesTried(const GateSide& side) {
  std::set<std::pair<std::string, std::string>> states;
  for (const PinnedCell* cell : side.cells) {
    for (const PinnedOutcome& one : cell->outcomes) states.insert({cell->task, one.initial_state});
  }
  return std::ssize(states);
}

/// A fact of this run, not a sample of others: no test.
void CountErrors(const GateRule& rule, const GateSides& sides, Evidence& evidence) {
  const GateSide& side = sides.candidate;
  const double share = static_cast<double>(side.errors) / static_cast<double>(side.episodes);
  evidence.decision.value = ClopperPearsonInterval(side.errors, side.episodes, 1 - 2 * rule.alpha);
  evidence.decision.states = side.episodes;
  evidence.initial_states = StatesTried(side);
  evidence.decision.p = Undefined{"errors are counted, not tested"};
  evidence.decision.statement = fmt::format("{} of {}{} ({}) could not go on", side.errors,
                                            Counted(side.episodes, "episode"),
                                            side.policy.empty() ? "" : " of " + side.policy, Percent(share));
  evidence.good = "at most " + GivenPercent(*rule.at_most);
  evidence.bad = "more than " + GivenPercent(*rule.at_most);
  evidence.counted = share <= *rule.at_most ? GateOutcome::kPass : GateOutcome::kFail;
}

}  // namespace

Estimate RateOfStates(const std::vector<Count>& states, double confidence) {
  Estimate rate = ClusteredWilsonInterval(states, confidence);
  const std::int64_t tried = std::ranges::count_if(states, [](const Count& count) { return count.trials > 0; });
  rate.interval = Interval{std::min(rate.interval->low, WilsonInterval(tried, tried, confidence).interval->low),
                           std::max(rate.interval->high, WilsonInterval(0, tried, confidence).interval->high)};
  return rate;
}

void ExamineQuality(const GateRule& rule, const RunSummary& run, const GateSides& sides, Evidence& evidence) {
  if (rule.test == GateTest::kCiLower) HoldRate(rule, sides, evidence);
  if (rule.test == GateTest::kCorrelation) HoldCorrelation(rule, run, sides, evidence);
  if (rule.test == GateTest::kJudgeKappa) HoldKappa(rule, run, sides, evidence);
  if (rule.test == GateTest::kErrorShare) CountErrors(rule, sides, evidence);
}

}  // namespace evac
