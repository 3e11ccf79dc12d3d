#include "reports/policy_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/statistics/many_comparisons.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/special.h"
#include "core/statistics/stratified.h"
#include "core/statistics/two_samples.h"
#include "reports/comparison.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Share of the larger side's episodes from which on only pairs are looked at.
constexpr double kPairedFrom = 0.8;

/// A difference below this is 0 but for rounding: no rates of fewer than ten thousand episodes are as near.
constexpr double kNoDifference = 1e-9;

using Where = std::pair<std::string, std::uint64_t>;  // initial state, seed

/// One policy's episodes of one task that count, and how many do not.
struct Side {
  std::map<Where, const JudgedEpisode*> counted;
  std::int64_t apart = 0;
};

std::map<std::string, Side> SidesByTask(const ComparedPolicy& policy) {
  std::map<std::string, Side> sides;
  for (const JudgedEpisode& judged : policy.episodes) {
    const PairKey& pair = judged.episode.key.pair;
    Side& side = sides[pair.task];
    if (judged.Counts()) {
      side.counted[{pair.initial_state, pair.seed}] = &judged;
    } else {
      ++side.apart;
    }
  }
  return sides;
}

bool Succeeded(const JudgedEpisode& judged) { return judged.outcome == Outcome::kSuccess; }

Estimate RateOfSide(const Side& side, double confidence) {
  std::vector<const JudgedEpisode*> episodes;
  for (const auto& [where, judged] : side.counted) episodes.push_back(judged);
  return RateOf(episodes, confidence);
}

/// By initial state, so that repeats of one do not count as if they were new.
std::vector<Count> StatesOf(const Side& side) {
  std::map<std::string, Count> states;
  for (const auto& [where, judged] : side.counted) {
    Count& state = states[where.first];
    ++state.trials;
    state.successes += Succeeded(*judged);
  }
  std::vector<Count> clusters;
  for (const auto& [state, count] : states) clusters.push_back(count);
  return clusters;
}

Side SharedPart(const Side& side, const Side& other) {
  Side shared = side;
  std::erase_if(shared.counted, [&](const auto& entry) { return !other.counted.contains(entry.first); });
  return shared;
}

Flips FlipsOf(const Side& first, const Side& second) {
  Flips flips;
  for (const auto& [where, judged] : first.counted) {
    const auto partner = second.counted.find(where);
    if (partner == second.counted.end()) continue;
    flips.only_first += Succeeded(*judged) && !Succeeded(*partner->second);
    flips.only_second += !Succeeded(*judged) && Succeeded(*partner->second);
  }
  return flips;
}

/// Pairs by initial state, so that repeats of one do not count as if they were new.
std::vector<PairedOutcomes> PairsByState(const Side& first, const Side& second) {
  std::map<std::string, PairedOutcomes> states;
  for (const auto& [where, judged] : first.counted) {
    const auto partner = second.counted.find(where);
    if (partner == second.counted.end()) continue;
    PairedOutcomes& state = states[where.first];
    ++state.pairs;
    state.flips.only_first += Succeeded(*judged) && !Succeeded(*partner->second);
    state.flips.only_second += !Succeeded(*judged) && Succeeded(*partner->second);
  }
  std::vector<PairedOutcomes> clusters;
  for (const auto& [state, outcomes] : states) clusters.push_back(outcomes);
  return clusters;
}

bool IsNone(double difference) { return std::abs(difference) < kNoDifference; }

Winner WinnerOf(const ComparisonRow& row, const Number& p, double alpha) {
  if (!p || !row.difference.value || *p > alpha || IsNone(*row.difference.value)) return Winner::kNotDecided;
  return *row.difference.value > 0 ? Winner::kFirst : Winner::kSecond;
}

/// From the flips that as many independent pairs would have had, half a flip added to each kind so that none is thought
/// impossible.
Defined<std::int64_t> MorePairs(const ComparisonRow& row, const Promise& promise) {
  const auto [b, c] = row.flips;
  if (b == c) return Undefined{b == 0 ? "no pair differs" : "the flips lean to neither side"};
  const double n = static_cast<double>(row.pairs.effective), each = n / static_cast<double>(row.pairs.all);
  const FlipRates rates{(static_cast<double>(b) * each + 0.5) / (n + 1),
                        (static_cast<double>(c) * each + 0.5) / (n + 1)};
  const SampleSize size = PairsForMcNemar(rates, promise);
  if (!size.exact) return Undefined{size.exact.reason()};
  return FurtherWanted(static_cast<double>(size.n), row.pairs);
}

/// As many of each as that one lacks that lacks more.
Defined<std::int64_t> FurtherOfEach(double wanted_of_first, double wanted_of_second, const ComparisonRow& row) {
  const Defined<std::int64_t> first = FurtherWanted(wanted_of_first, row.first_trials);
  const Defined<std::int64_t> second = FurtherWanted(wanted_of_second, row.second_trials);
  if (!first || !second) return Undefined{first ? second.reason() : first.reason()};
  return std::max(*first, *second);
}

/// Every stratum grows alike, so that the difference's variance falls as episodes are added.
Defined<std::int64_t> MoreOfEachTask(const ComparisonRow& row, const Promise& promise) {
  const double z = TwoSidedZ(1 - promise.alpha) + NormalQuantile(promise.power);
  const double times = std::pow(z * *row.stratified_se / *row.difference.value, 2);
  return FurtherOfEach(times * static_cast<double>(row.first_trials.effective),
                       times * static_cast<double>(row.second_trials.effective), row);
}

Defined<std::int64_t> MoreEpisodes(const ComparisonRow& row, const Promise& promise) {
  if (!row.first.value || !row.second.value) return Undefined{"one of the two has no episode that counts"};
  if (IsNone(*row.difference.value)) return Undefined{"the two rates are equal"};  // task by task, where there are several
  if (row.stratified_se) return MoreOfEachTask(row, promise);
  const SampleSize size = TrialsPerPolicy(*row.first.value, *row.second.value, promise);
  if (!size.exact) return Undefined{size.exact.reason()};
  const double wanted = static_cast<double>(size.n);
  return FurtherOfEach(wanted, wanted, row);
}

/// Winner and "how many more", once the p that counts is known.
/// @param family  how many p-values alpha was shared among; planned for the strictest of Holm's steps.
void Decide(const ComparisonOptions& options, std::size_t family, ComparisonRow& row) {
  row.winner = WinnerOf(row, row.p_holm, options.alpha);
  if (row.winner != Winner::kNotDecided) return;
  const Promise promise{options.alpha / static_cast<double>(std::max<std::size_t>(1, family)), options.power};
  row.more = MoreToDecide(row, promise);
}

void ComparePaired(const Side& first, const Side& second, const ComparisonOptions& options, ComparisonRow& row) {
  row.first = RateOfSide(SharedPart(first, second), options.confidence());
  row.second = RateOfSide(SharedPart(second, first), options.confidence());
  const std::vector<PairedOutcomes> states = PairsByState(first, second);
  const PairedOutcomes effective = EffectivePairs(states);
  row.difference = TangoOfClusters(states, options.confidence());
  row.difference.method = OnPairs("Tango", PairsOfInterval(states, options.confidence()));
  row.pairs = {row.shared, effective.pairs};
  row.test = OnPairs("exact McNemar", row.pairs);
  if (row.shared > 0) row.p = McNemarExact(effective.flips).p_exact;
}

void CompareUnpaired(const Side& first, const Side& second, const ComparisonOptions& options, ComparisonRow& row) {
  const std::vector<Count> one = StatesOf(first), two = StatesOf(second);
  const TwoSampleTest test = BoschlooOrNewcombe(one, two);
  row.first = RateOfSide(first, options.confidence());
  row.second = RateOfSide(second, options.confidence());
  row.first_trials = {row.first_episodes, EffectiveCount(one).trials};
  row.second_trials = {row.second_episodes, EffectiveCount(two).trials};
  row.difference = NewcombeOfRates(row.first, row.second);
  row.difference.method = OnEpisodes("Newcombe", row.first_trials, row.second_trials);
  row.test = OnEpisodes(test.method, row.first_trials, row.second_trials);
  if (!one.empty() && !two.empty()) row.p = test.two_sided;
}

/// What there is to compare, and whether as pairs.
ComparisonRow CountedRow(const std::string& task, const Side& first, const Side& second) {
  ComparisonRow row;
  row.task = task;
  row.first_episodes = static_cast<std::int64_t>(first.counted.size());
  row.second_episodes = static_cast<std::int64_t>(second.counted.size());
  row.first_apart = first.apart;
  row.second_apart = second.apart;
  row.shared = static_cast<std::int64_t>(SharedPart(first, second).counted.size());
  row.flips = FlipsOf(first, second);
  const double most = static_cast<double>(std::max(row.first_episodes, row.second_episodes));
  row.is_paired = row.shared > 0 && static_cast<double>(row.shared) >= kPairedFrom * most;
  return row;
}

ComparisonRow CompareTask(const std::string& task, const Side& first, const Side& second,
                          const ComparisonOptions& options) {
  ComparisonRow row = CountedRow(task, first, second);
  row.is_paired ? ComparePaired(first, second, options, row) : CompareUnpaired(first, second, options, row);
  return row;
}

void AdjustForTasks(const ComparisonOptions& options, std::vector<ComparisonRow>& rows) {
  std::vector<double> p_values;
  for (const ComparisonRow& row : rows) {
    if (row.p) p_values.push_back(*row.p);
  }
  const std::vector<double> adjusted = HolmAdjusted(p_values);
  auto next = adjusted.begin();
  for (ComparisonRow& row : rows) {
    if (row.p) row.p_holm = *next++;
    Decide(options, p_values.size(), row);
  }
}

/// The episodes of all tasks as one side; states keep their task's name so that they stay apart.
Side AllTasks(const std::map<std::string, Side>& sides) {
  Side all;
  for (const auto& [task, side] : sides) {
    for (const auto& [where, judged] : side.counted) all.counted[{task + "\n" + where.first, where.second}] = judged;
  }
  return all;
}

/// A task is a stratum, of its effective trials: one weighting makes the difference and its interval. Rates are pooled.
void Stratify(const std::map<std::string, Side>& first, const std::map<std::string, Side>& second,
              const ComparisonOptions& options, ComparisonRow& row) {
  std::vector<Stratum> strata;
  double one = 0, two = 0;
  for (const auto& [task, side] : first) {
    strata.push_back({EffectiveTrials(StatesOf(side)), EffectiveTrials(StatesOf(second.at(task)))});
    one += strata.back().first.trials;
    two += strata.back().second.trials;
  }
  row.first = RateOfSide(AllTasks(first), options.confidence());
  row.second = RateOfSide(AllTasks(second), options.confidence());
  row.first_trials = {row.first_episodes, std::llround(one)};
  row.second_trials = {row.second_episodes, std::llround(two)};
  const StratifiedTest test = MantelHaenszel(strata, options.confidence());
  row.difference = test.risk_difference;
  row.difference.method = OnEpisodes(row.difference.method, row.first_trials, row.second_trials);
  row.test = OnEpisodes("Cochran-Mantel-Haenszel", row.first_trials, row.second_trials);
  row.stratified_se = test.difference_se;
  row.p = test.p;
}

/// Takes the tasks out in which one of the two has nothing that counts. Both maps have every task.
std::vector<std::string> LeaveOut(std::map<std::string, Side>& first, std::map<std::string, Side>& second) {
  std::vector<std::string> left_out;
  for (const auto& [task, side] : first) {
    if (side.counted.empty() || second.at(task).counted.empty()) left_out.push_back(task);
  }
  for (const std::string& task : left_out) {
    first.erase(task);
    second.erase(task);
  }
  return left_out;
}

/// Paired: each pair is a stratum of its own, so that the pooled flips are the stratified test already.
/// @param first, second  of the same tasks, each with episodes that count.
ComparisonRow CompareAll(const std::map<std::string, Side>& first, const std::map<std::string, Side>& second,
                         const ComparisonOptions& options) {
  const Side one = AllTasks(first), two = AllTasks(second);
  ComparisonRow row = CountedRow("", one, two);
  if (row.is_paired) {
    ComparePaired(one, two, options, row);
  } else if (first.size() > 1) {
    Stratify(first, second, options, row);
  } else {
    CompareUnpaired(one, two, options, row);
  }
  row.p_holm = row.p;
  Decide(options, 1, row);
  return row;
}

}  // namespace

Defined<std::int64_t> MoreToDecide(const ComparisonRow& row, const Promise& promise) {
  return row.is_paired ? MorePairs(row, promise) : MoreEpisodes(row, promise);
}

PolicyComparison ComparePolicies(const ComparedPolicy& first, const ComparedPolicy& second,
                                 const ComparisonOptions& options) {
  const auto is_share = [](double x) { return x > 0 && x < 1; };
  if (!is_share(options.alpha) || !is_share(options.power)) {
    throw InvalidInput("compare: alpha is {} and power {}, wanted both between 0 and 1", options.alpha, options.power);
  }
  std::map<std::string, Side> one = SidesByTask(first), two = SidesByTask(second);
  std::set<std::string> tasks;
  for (const auto& [task, side] : one) tasks.insert(task);
  for (const auto& [task, side] : two) tasks.insert(task);
  if (tasks.empty()) throw InvalidInput("compare: neither {} nor {} has an episode here", first.name, second.name);
  PolicyComparison comparison{first.name, second.name, options, {}, {}, {}};
  for (const std::string& task : tasks) comparison.tasks.push_back(CompareTask(task, one[task], two[task], options));
  AdjustForTasks(options, comparison.tasks);
  comparison.left_out = LeaveOut(one, two);
  comparison.all = CompareAll(one, two, options);
  for (const ComparisonRow& row : comparison.tasks) {
    comparison.all.first_apart += row.first_apart;
    comparison.all.second_apart += row.second_apart;
  }
  return comparison;
}

}  // namespace evac
