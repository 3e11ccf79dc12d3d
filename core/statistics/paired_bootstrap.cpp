#include "core/statistics/paired_bootstrap.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/association.h"

namespace evac {
namespace {

/// How often each state of each task is taken: [tasks][states]. All 1 is the data as they are.
using Weights = std::vector<std::vector<std::int64_t>>;

using Statistic = std::function<Number(const RatePairs&)>;

std::size_t StatesOf(const TaskOutcomes& task) { return task.points.empty() ? 0 : task.points[0].real.size(); }

void Check(const std::vector<TaskOutcomes>& tasks, const BootstrapOptions& options) {
  if (options.replicates < 1) throw InvalidInput("statistics: {} replicates, wanted at least 1", options.replicates);
  for (const TaskOutcomes& task : tasks) {
    for (const PointOutcomes& point : task.points) {
      if (point.real.size() != StatesOf(task) || point.sim.size() != StatesOf(task)) {
        throw InvalidInput("statistics: points of one task with {}, {} and {} states, wanted the same number",
                           StatesOf(task), point.real.size(), point.sim.size());
      }
    }
  }
}

Count Weighted(const std::vector<Count>& states, const std::vector<std::int64_t>& weights) {
  Count total;
  for (std::size_t i = 0; i < states.size(); ++i) {
    total.successes += weights[i] * states[i].successes;
    total.trials += weights[i] * states[i].trials;
  }
  return total;
}

/// The rates under these weights; points without trials in one of the worlds are left out.
RatePairs WeightedRates(const std::vector<TaskOutcomes>& tasks, const Weights& weights) {
  RatePairs rates;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    for (const PointOutcomes& point : tasks[t].points) {
      const Count real = Weighted(point.real, weights[t]), sim = Weighted(point.sim, weights[t]);
      if (real.trials == 0 || sim.trials == 0) continue;
      rates.real.push_back(static_cast<double>(real.successes) / static_cast<double>(real.trials));
      rates.sim.push_back(static_cast<double>(sim.successes) / static_cast<double>(sim.trials));
    }
  }
  return rates;
}

Weights EachOnce(const std::vector<TaskOutcomes>& tasks) {
  Weights weights;
  for (const TaskOutcomes& task : tasks) weights.emplace_back(StatesOf(task), 1);
  return weights;
}

/// As many draws per task as it has states.
Weights Draw(const std::vector<TaskOutcomes>& tasks, SplitMix64& random) {
  Weights weights;
  for (const TaskOutcomes& task : tasks) {
    std::vector<std::int64_t>& taken = weights.emplace_back(StatesOf(task), 0);
    for (std::size_t draw = 0; draw < taken.size(); ++draw) ++taken[random.Below(taken.size())];
  }
  return weights;
}

/// The rates of every way to resample, computed once for all statistics. Those that lost a point are not kept.
struct ResampledRates {
  RatePairs all;
  std::vector<RatePairs> replicates, jackknife;
  std::int64_t incomplete = 0;  ///< replicates that lost a point
};

ResampledRates Resample(const std::vector<TaskOutcomes>& tasks, const BootstrapOptions& options) {
  ResampledRates result;
  Weights weights = EachOnce(tasks);
  result.all = WeightedRates(tasks, weights);
  SplitMix64 random(options.seed);
  for (int replicate = 0; replicate < options.replicates; ++replicate) {
    RatePairs rates = WeightedRates(tasks, Draw(tasks, random));
    if (rates.real.size() == result.all.real.size()) {
      result.replicates.push_back(std::move(rates));
    } else {
      ++result.incomplete;
    }
  }
  for (std::vector<std::int64_t>& states : weights) {
    for (std::int64_t& state : states) {
      state = 0;
      RatePairs rates = WeightedRates(tasks, weights);
      state = 1;
      if (rates.real.size() == result.all.real.size()) result.jackknife.push_back(std::move(rates));
    }
  }
  return result;
}

Defined<BootstrapOf> Bootstrap(const ResampledRates& rates, const Statistic& statistic, double confidence) {
  const Number theta = statistic(rates.all);
  if (!theta) return Undefined{theta.reason()};
  BootstrapOf result;
  result.resampled.theta = *theta;
  result.undefined = rates.incomplete;
  for (const RatePairs& replicate : rates.replicates) {
    const Number value = statistic(replicate);
    if (value) result.resampled.replicates.push_back(*value);
    result.undefined += !value;
  }
  for (const RatePairs& left_one_out : rates.jackknife) {
    if (const Number value = statistic(left_one_out)) result.resampled.jackknife.push_back(*value);
  }
  result.intervals = IntervalsOf(result.resampled, confidence);
  return result;
}

}  // namespace

RatePairs RatesOf(const std::vector<TaskOutcomes>& tasks) { return WeightedRates(tasks, EachOnce(tasks)); }

PairedBootstrap PairedStateBootstrap(const std::vector<TaskOutcomes>& tasks, const MmrvConvention& convention,
                                     const BootstrapOptions& options) {
  Check(tasks, options);
  const ResampledRates rates = Resample(tasks, options);
  const auto bootstrap = [&](const Statistic& statistic) { return Bootstrap(rates, statistic, options.confidence); };
  PairedBootstrap result;
  result.method = fmt::format("paired state bootstrap, percentile, B={}, seed {}", options.replicates, options.seed);
  result.pearson = bootstrap([](const RatePairs& pairs) { return Pearson(pairs.sim, pairs.real).value; });
  result.spearman = bootstrap([](const RatePairs& pairs) { return Spearman(pairs.sim, pairs.real).value; });
  result.mmrv = bootstrap([&](const RatePairs& pairs) { return Mmrv(pairs, convention).mmrv; });
  return result;
}

}  // namespace evac
