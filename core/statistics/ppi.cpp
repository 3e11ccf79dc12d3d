#include "core/statistics/ppi.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/betting.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

constexpr std::int64_t kLeastReal = 40, kLeastDiscordant = 5;
constexpr double kNoSpread = 1e-12;  // what rounding leaves of 0

void Check(const BothWorlds& paired, const Count& more) {
  if (std::min({paired.both, paired.only_real, paired.only_model, paired.neither}) < 0) {
    throw InvalidInput("statistics: a table of both worlds with a negative count");
  }
  CheckCount(more);
}

/// The moments PPI is made of, all with 1 / n.
struct Moments {
  Moments(const BothWorlds& paired, const Count& more) {
    n = static_cast<double>(paired.n());
    extra = static_cast<double>(more.trials);
    real = static_cast<double>(paired.both + paired.only_real) / n;
    model = static_cast<double>(paired.both + paired.only_model) / n;
    covariance = static_cast<double>(paired.both) / n - real * model;
    model_more = extra > 0 ? static_cast<double>(more.successes) / extra : 0;
    pooled_successes = static_cast<double>(paired.both + paired.only_model + more.successes);
  }
  /// Of G and H together, with ddof 1.
  double PooledVariance() const {
    const double all = n + extra, p = pooled_successes / all;
    return all > 1 ? p * (1 - p) * all / (all - 1) : 0;
  }
  double n, extra, real, model, covariance, model_more, pooled_successes;
};

Number TunedLambda(const Moments& m) {
  if (m.extra == 0) return Undefined{"no further model outcomes"};
  if (m.pooled_successes == 0 || m.pooled_successes == m.n + m.extra) return Undefined{"all model outcomes are equal"};
  return m.covariance / ((1 + m.n / m.extra) * m.PooledVariance());
}

/// Y - lambda G of each kind of pair, less the mean, summed over the pairs of one state.
double RectifiedSum(const BothWorlds& state, const Moments& m, double lambda) {
  const double mean = m.real - lambda * m.model;
  const auto term = [&](std::int64_t count, double value) { return static_cast<double>(count) * (value - mean); };
  return term(state.both, 1 - lambda) + term(state.only_real, 1) + term(state.only_model, -lambda) +
         term(state.neither, 0);
}

/// The variance of Y - lambda G over the four kinds of pairs, without cancellation.
double RectifiedVariance(const BothWorlds& paired, const Moments& m, double lambda) {
  const double mean = m.real - lambda * m.model;
  const auto term = [&](std::int64_t count, double value) {
    return static_cast<double>(count) / m.n * (value - mean) * (value - mean);
  };
  return term(paired.both, 1 - lambda) + term(paired.only_real, 1) + term(paired.only_model, -lambda) +
         term(paired.neither, 0);
}

/// What the normal interval rests on: pairs, or initial states where they repeat.
struct Basis {
  std::int64_t real = 0, discordant = 0;
  const char *trials = "real trials", *pairs = "pairs";
};

Defined<Interval> Allowed(const Basis& basis, const Interval& normal, double se) {
  if (basis.real < kLeastReal) return Undefined{fmt::format("fewer than {} {}", kLeastReal, basis.trials)};
  if (basis.discordant < kLeastDiscordant)
    return Undefined{fmt::format("fewer than {} {} in which the worlds differ", kLeastDiscordant, basis.pairs)};
  if (se <= kNoSpread) return Undefined{"the estimated spread is 0"};
  return Interval{std::clamp(normal.low, 0.0, 1.0), std::clamp(normal.high, 0.0, 1.0)};
}

/// lambda from the pairs so far, with one pair of each kind added so that it starts at 0 and moves slowly.
double PredictableLambda(const BothWorlds& so_far, double pairs_per_more) {
  const double n = static_cast<double>(so_far.n()) + 4;
  const double real = static_cast<double>(so_far.both + so_far.only_real + 2) / n;
  const double model = static_cast<double>(so_far.both + so_far.only_model + 2) / n;
  const double covariance = static_cast<double>(so_far.both + 1) / n - real * model;
  return std::clamp(covariance / (model * (1 - model) * (1 + pairs_per_more)), 0.0, 1.0);
}

void AddTo(BothWorlds& table, const BothOutcomes& outcomes) {
  const auto [real, model] = outcomes;
  ++(real ? (model ? table.both : table.only_real) : (model ? table.only_model : table.neither));
}

/// Z_t = Y_t + lambda_t (H_t - G_t) in [-1, 2].
std::vector<double> RectifiedSequence(const std::vector<BothOutcomes>& paired, const std::vector<bool>& more) {
  const std::size_t n = paired.size(), extra = more.size();
  BothWorlds so_far;
  std::vector<double> values;
  for (std::size_t t = 0; t < n; ++t) {
    const std::size_t first = t * extra / n, last = (t + 1) * extra / n;  // this pair's share of the further outcomes
    const double real = paired[t].real ? 1 : 0, model = paired[t].model ? 1 : 0;
    if (first == last) {
      values.push_back(real);
    } else {
      const double successes = static_cast<double>(std::count(more.begin() + static_cast<std::ptrdiff_t>(first),
                                                              more.begin() + static_cast<std::ptrdiff_t>(last), true));
      const double share = static_cast<double>(last - first);
      values.push_back(real + PredictableLambda(so_far, 1 / share) * (successes / share - model));
    }
    AddTo(so_far, paired[t]);
  }
  return values;
}

template <typename Outcome>
std::vector<Outcome> Shuffled(const std::vector<Outcome>& outcomes, std::uint64_t seed) {
  std::vector<double> places;
  for (std::size_t i = 0; i < outcomes.size(); ++i) places.push_back(static_cast<double>(i));
  std::vector<Outcome> shuffled;
  for (const double place : SeededShuffle(places, seed)) shuffled.push_back(outcomes[static_cast<std::size_t>(place)]);
  return shuffled;
}

bool HasRepeats(const PpiStates& states) {
  return std::ranges::any_of(states.paired, [](const BothWorlds& state) { return state.n() > 1; }) ||
         std::ranges::any_of(states.more, [](const Count& state) { return state.trials > 1; });
}

/// Of the mean of Y - lambda G, from the states' sums; undefined where they cannot show it.
Number RectifierVariance(const PpiStates& states, const Moments& m, double lambda) {
  double squares = 0, groups = 0;
  for (const BothWorlds& state : states.paired) {
    if (state.n() == 0) continue;
    squares += std::pow(RectifiedSum(state, m, lambda), 2);
    ++groups;
  }
  if (groups < 2) return Undefined{"all pairs are of one initial state"};
  return std::max(groups / (groups - 1) * squares / (m.n * m.n),
                  RectifiedVariance(states.Paired(), m, lambda) / m.n);
}

/// Of the mean of H.
Number FurtherVariance(const PpiStates& states, const Moments& m) {
  const double independent = m.model_more * (1 - m.model_more) / m.extra;
  const ClusterStatistics clusters = StatisticsOfClusters(states.more);
  if (clusters.clusters == clusters.trials) return independent;
  if (!clusters.cluster_se) return Undefined{"all further outcomes are of one initial state"};
  return std::max(independent, *clusters.cluster_se * *clusters.cluster_se);
}

/// Over initial states; undefined where they are too few to show it.
Number SeByState(const PpiStates& states, const Moments& m, double lambda) {
  const Number rectifier = RectifierVariance(states, m, lambda);
  if (!rectifier) return rectifier;
  if (lambda == 0) return std::sqrt(*rectifier);
  const Number further = FurtherVariance(states, m);
  if (!further) return further;
  return std::sqrt(*rectifier + lambda * lambda * *further);
}

Estimate NothingKnown(const BothWorlds& paired, double confidence) {
  TwoSidedZ(confidence);  // complains
  Estimate estimate;
  estimate.confidence = confidence;
  estimate.n = paired.n();
  estimate.value = Undefined{"no real trials"};
  estimate.interval = Interval{0, 1};
  return estimate;
}

}  // namespace

PpiEstimate PpiMean(const BothWorlds& paired, const Count& more, PpiWeight weight, double confidence) {
  Check(paired, more);
  const double z = TwoSidedZ(confidence);
  PpiEstimate result;
  if (paired.n() == 0) return result;
  const Moments m(paired, more);
  if (weight == PpiWeight::kFull) result.lambda = 1;
  if (weight == PpiWeight::kTuned) {
    result.tuned_lambda = TunedLambda(m);
    result.lambda = result.tuned_lambda ? std::clamp(*result.tuned_lambda, 0.0, 1.0) : 0;
  }
  if (result.lambda > 0 && more.trials == 0) {
    result.value = result.se = Undefined{"no further model outcomes"};
    result.normal = result.allowed = Undefined{"no further model outcomes"};
    return result;
  }
  const double value = result.lambda * m.model_more + m.real - result.lambda * m.model;
  double variance = RectifiedVariance(paired, m, result.lambda) / m.n;
  if (more.trials > 0) variance += result.lambda * result.lambda * m.model_more * (1 - m.model_more) / m.extra;
  const double se = std::sqrt(variance);
  const Interval normal{value - z * se, value + z * se};
  result.value = value;
  result.se = se;
  result.normal = normal;
  result.allowed = Allowed({paired.n(), paired.discordant()}, normal, se);
  return result;
}

PpiEstimate PpiMeanByState(const PpiStates& states, PpiWeight weight, double confidence) {
  const BothWorlds paired = states.Paired();
  PpiEstimate result = PpiMean(paired, states.More(), weight, confidence);
  if (!result.se || !HasRepeats(states)) return result;
  result.se = SeByState(states, Moments(paired, states.More()), result.lambda);
  if (!result.se) {
    result.normal = result.allowed = Undefined{result.se.reason()};
    return result;
  }
  const double half = TwoSidedZ(confidence) * *result.se;
  const Interval normal{*result.value - half, *result.value + half};
  const auto count = [&](auto counts) { return std::ranges::count_if(states.paired, counts); };
  result.normal = normal;
  result.allowed = Allowed({count([](const BothWorlds& state) { return state.n() > 0; }),
                            count([](const BothWorlds& state) { return state.discordant() > 0; }),
                            "initial states tried for real", "initial states"},
                           normal, *result.se);
  return result;
}

Estimate PpiMoverByState(const PpiStates& states, double confidence) {
  const BothWorlds paired = states.Paired();
  Estimate rate = PpiMover(paired, states.More(), confidence);
  if (!rate.value || !HasRepeats(states)) return rate;
  std::vector<PairedOutcomes> clusters;
  for (const BothWorlds& state : states.paired) clusters.push_back({{state.only_real, state.only_model}, state.n()});
  const Estimate rectifier = TangoOfClusters(clusters, confidence);
  const Interval sum = MoverSum(ClusteredWilsonInterval(states.more, confidence), rectifier);
  rate.interval = Interval{std::clamp(sum.low, 0.0, 1.0), std::clamp(sum.high, 0.0, 1.0)};
  return rate;
}

BothWorlds PpiStates::Paired() const {
  BothWorlds all;
  for (const BothWorlds& state : paired) {
    all.both += state.both;
    all.only_real += state.only_real;
    all.only_model += state.only_model;
    all.neither += state.neither;
  }
  return all;
}

Estimate PpiMover(const BothWorlds& paired, const Count& more, double confidence) {
  Check(paired, more);
  Estimate rate = NothingKnown(paired, confidence);
  rate.method = "MOVER of Wilson and Tango";
  if (!rate.value && paired.n() > 0) rate.value = Undefined{"no further model outcomes"};
  if (paired.n() == 0 || more.trials == 0) return rate;
  const Estimate model = WilsonInterval(more.successes, more.trials, confidence);
  const Estimate rectifier = TangoDifference({{paired.only_real, paired.only_model}, paired.n()}, confidence);
  const Interval sum = MoverSum(model, rectifier);
  rate.value = *model.value + *rectifier.value;
  rate.interval = Interval{std::clamp(sum.low, 0.0, 1.0), std::clamp(sum.high, 0.0, 1.0)};
  return rate;
}

Estimate PpiBetting(const std::vector<BothOutcomes>& paired, const std::vector<bool>& more,
                    const PpiBettingOptions& options) {
  const BothWorlds table = TableOf(paired);
  Estimate rate = NothingKnown(table, options.confidence);
  rate.method = fmt::format("betting on tuned differences, seed {}", options.seed);
  if (paired.empty()) return rate;
  std::vector<double> values =
      RectifiedSequence(Shuffled(paired, options.seed), Shuffled(more, options.seed ^ 0x9e3779b97f4a7c15ULL));
  for (double& value : values) value = std::clamp((value + 1) / 3, 0.0, 1.0);
  const Estimate scaled = BettingInterval(values, {.confidence = options.confidence});
  const std::int64_t successes = std::ranges::count(more, true);
  rate.value = PpiMean(table, {successes, static_cast<std::int64_t>(more.size())}, PpiWeight::kTuned).value;
  rate.interval = Undefined{scaled.interval.reason()};
  if (scaled.interval) {
    rate.interval = Interval{std::clamp(3 * scaled.interval->low - 1, 0.0, 1.0),
                             std::clamp(3 * scaled.interval->high - 1, 0.0, 1.0)};
  }
  return rate;
}

BothWorlds TableOf(const std::vector<BothOutcomes>& paired) {
  BothWorlds table;
  for (const BothOutcomes& outcomes : paired) AddTo(table, outcomes);
  return table;
}

}  // namespace evac
