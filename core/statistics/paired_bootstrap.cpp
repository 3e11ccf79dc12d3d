#include "core/statistics/paired_bootstrap.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <span>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/association.h"

namespace evac {
namespace {

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

/// One task's counts with all of a state's side by side, so that a state that is drawn is added in one go:
/// [states][points][real successes, real trials, sim successes, sim trials].
class StateRows {
 public:
  explicit StateRows(const TaskOutcomes& task) : columns_(4 * task.points.size()), states_(StatesOf(task)) {
    for (std::size_t state = 0; state < states_; ++state) {
      for (const PointOutcomes& point : task.points) {
        const Count &real = point.real[state], &sim = point.sim[state];
        cells_.insert(cells_.end(), {real.successes, real.trials, sim.successes, sim.trials});
      }
    }
  }
  std::size_t states() const { return states_; }
  std::size_t columns() const { return columns_; }

  void AddTo(std::span<std::int64_t> totals, std::size_t state) const {
    const std::int64_t* row = cells_.data() + state * columns_;
    for (std::size_t i = 0; i < columns_; ++i) totals[i] += row[i];
  }
  void TakeFrom(std::span<std::int64_t> totals, std::size_t state) const {
    const std::int64_t* row = cells_.data() + state * columns_;
    for (std::size_t i = 0; i < columns_; ++i) totals[i] -= row[i];
  }

 private:
  std::size_t columns_, states_;
  std::vector<std::int64_t> cells_;
};

/// Sums over the states taken: [tasks][points][4].
using Totals = std::vector<std::vector<std::int64_t>>;

std::vector<StateRows> RowsOf(const std::vector<TaskOutcomes>& tasks) { return {tasks.begin(), tasks.end()}; }

Totals EachOnce(const std::vector<StateRows>& tasks) {
  Totals totals;
  for (const StateRows& task : tasks) {
    std::vector<std::int64_t>& sums = totals.emplace_back(task.columns(), 0);
    for (std::size_t state = 0; state < task.states(); ++state) task.AddTo(sums, state);
  }
  return totals;
}

/// As many draws per task as it has states.
Totals Draw(const std::vector<StateRows>& tasks, SplitMix64& random) {
  Totals totals;
  for (const StateRows& task : tasks) {
    std::vector<std::int64_t>& sums = totals.emplace_back(task.columns(), 0);
    for (std::size_t draw = 0; draw < task.states(); ++draw) task.AddTo(sums, random.Below(task.states()));
  }
  return totals;
}

/// Points without trials in one of the worlds are left out.
RatePairs RatesOfTotals(const Totals& totals) {
  RatePairs rates;
  for (const std::vector<std::int64_t>& task : totals) {
    for (std::size_t i = 0; i < task.size(); i += 4) {
      if (task[i + 1] == 0 || task[i + 3] == 0) continue;
      rates.real.push_back(static_cast<double>(task[i]) / static_cast<double>(task[i + 1]));
      rates.sim.push_back(static_cast<double>(task[i + 2]) / static_cast<double>(task[i + 3]));
    }
  }
  return rates;
}

/// The rates of every way to resample, computed once for all statistics. Those that lost a point are not kept.
struct ResampledRates {
  RatePairs all;
  std::vector<RatePairs> replicates, jackknife;
  std::int64_t incomplete = 0;  ///< replicates that lost a point
};

ResampledRates Resample(const std::vector<TaskOutcomes>& outcomes, const BootstrapOptions& options) {
  const std::vector<StateRows> tasks = RowsOf(outcomes);
  ResampledRates result;
  Totals totals = EachOnce(tasks);
  result.all = RatesOfTotals(totals);
  SplitMix64 random(options.seed);
  for (int replicate = 0; replicate < options.replicates; ++replicate) {
    RatePairs rates = RatesOfTotals(Draw(tasks, random));
    if (rates.real.size() == result.all.real.size()) {
      result.replicates.push_back(std::move(rates));
    } else {
      ++result.incomplete;
    }
  }
  for (std::size_t task = 0; task < tasks.size(); ++task) {
    for (std::size_t state = 0; state < tasks[task].states(); ++state) {
      tasks[task].TakeFrom(totals[task], state);
      RatePairs rates = RatesOfTotals(totals);
      tasks[task].AddTo(totals[task], state);
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

RatePairs RatesOf(const std::vector<TaskOutcomes>& tasks) { return RatesOfTotals(EachOnce(RowsOf(tasks))); }

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
