#include <fmt/format.h>

#include "core/seed.h"
#include "core/statistics/mmrv.h"
#include "core/statistics/paired_bootstrap.h"
#include "core/statistics/rate_difference.h"
#include "tests/core/statistics/coverage.h"

namespace evac::coverage {
namespace {

constexpr double kConfidence = 0.9;  // of a gate with alpha .05
constexpr double kAtMost = 0.1, kMargin = 0.1;
constexpr int kDraws = 120;  // of each bootstrap

/// The true rates of two policies in both worlds; what happens in a state hangs on nothing else.
struct TwoPolicies {
  double real[2], sim[2];
  int states;

  double Truth() const { return *Mmrv({.real = {real[0], real[1]}, .sim = {sim[0], sim[1]}}).mmrv; }
  std::string Text() const { return fmt::format("{} {}, {} {}", real[0], real[1], sim[0], sim[1]); }
};
constexpr TwoPolicies kPolicies[] = {
    {{.9, .5}, {.5, .9}, 2},    {{.9, .5}, {.5, .9}, 3},    {{.95, .8}, {.8, .95}, 2},  {{.95, .8}, {.8, .95}, 3},
    {{.95, .8}, {.8, .95}, 6},  {{.95, .8}, {.8, .95}, 10}, {{.95, .8}, {.8, .95}, 20}, {{.95, .8}, {.8, .95}, 40},
    {{.99, .5}, {.99, .5}, 10}, {{.99, .5}, {.99, .5}, 40},
};

TaskOutcomes DrawTask(SplitMix64& random, const TwoPolicies& setting) {
  TaskOutcomes task;
  for (std::size_t policy = 0; policy < std::size(setting.real); ++policy) {
    PointOutcomes& point = task.points.emplace_back();
    for (int state = 0; state < setting.states; ++state) {
      point.real.push_back({random.Uniform() < setting.real[policy], 1});
      point.sim.push_back({random.Uniform() < setting.sim[policy], 1});
    }
  }
  return task;
}

/// Pairs of `repeats` seeds on each state; with probability rho those of one state all end as its first.
struct RepeatedPairs {
  int states, repeats;
  double better, worse, rho;

  double Difference() const { return better - worse; }
  std::string Text() const { return fmt::format("{} x {}, {} and {}", states, repeats, better, worse); }
};
constexpr RepeatedPairs kRepeated[] = {
    {20, 4, .02, .02, 0},  {20, 4, .02, .02, .5}, {20, 4, 0, .05, 0},  {20, 4, 0, .05, .9},
    {20, 4, .01, .11, .9}, {40, 5, .01, .01, 0},  {40, 5, 0, .05, .9}, {40, 5, .1, .1, .5},
};

Flips DrawPair(SplitMix64& random, const RepeatedPairs& setting) {
  const double u = random.Uniform();
  return {u < setting.better, u >= setting.better && u < setting.better + setting.worse};
}

std::vector<PairedOutcomes> DrawStates(SplitMix64& random, const RepeatedPairs& setting) {
  std::vector<PairedOutcomes> states;
  for (int i = 0; i < setting.states; ++i) {
    const bool are_copies = random.Uniform() < setting.rho;
    const Flips first = DrawPair(random, setting);
    PairedOutcomes state{first, setting.repeats};
    for (int repeat = 1; repeat < setting.repeats; ++repeat) {
      const Flips pair = are_copies ? first : DrawPair(random, setting);
      state.flips.only_first += pair.only_first;
      state.flips.only_second += pair.only_second;
    }
    states.push_back(state);
  }
  return states;
}

BeforeAndNow Shares(const BeforeAndNow& counts, const SimulationOptions& options) {
  return {counts.before / options.replicates, counts.now / options.replicates};
}

}  // namespace

std::vector<MmrvPasses> PassesOfMmrv(const SimulationOptions& options) {
  std::vector<MmrvPasses> table;
  for (const TwoPolicies& setting : kPolicies) {
    SplitMix64 random(SeedFor(options.seed, fmt::format("MMRV {} {}", setting.Text(), setting.states)));
    BeforeAndNow passes;
    for (int i = 0; i < options.replicates; ++i) {
      const PairedBootstrap bootstrap = PairedStateBootstrap(
          {DrawTask(random, setting)}, {}, {.replicates = kDraws, .seed = random.Next(), .confidence = kConfidence});
      const Defined<Interval> now = bootstrap.mmrv->of_record(kConfidence);
      passes.before += bootstrap.mmrv->intervals.percentile->high <= kAtMost;
      passes.now += now && now->high <= kAtMost;
    }
    table.push_back({setting.Text(), setting.states, setting.Truth(), Shares(passes, options)});
  }
  return table;
}

std::vector<RepeatedDifference> DifferencesOfRepeats(const SimulationOptions& options) {
  std::vector<RepeatedDifference> table;
  for (const RepeatedPairs& setting : kRepeated) {
    SplitMix64 random(SeedFor(options.seed, fmt::format("repeats {}, {}", setting.Text(), setting.rho)));
    const double truth = setting.Difference();
    const auto holds = [&](const Interval& interval) { return interval.low <= truth && truth <= interval.high; };
    BeforeAndNow covered, shown;
    for (int i = 0; i < options.replicates; ++i) {
      const std::vector<PairedOutcomes> states = DrawStates(random, setting);
      const Interval before = *TangoDifference(EffectivePairs(states), kConfidence).interval;
      const Interval now = *TangoOfClusters(states, kConfidence).interval;
      covered.before += holds(before);
      covered.now += holds(now);
      shown.before += before.low > -kMargin;
      shown.now += now.low > -kMargin;
    }
    table.push_back({setting.Text(), setting.rho, truth, Shares(covered, options), Shares(shown, options)});
  }
  return table;
}

}  // namespace evac::coverage
