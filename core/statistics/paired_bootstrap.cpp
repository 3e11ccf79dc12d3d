#include "core/statistics/paired_bootstrap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
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

/// How many rows of bytes are summed in 16 bits before they could overflow.
constexpr std::size_t kBlock = 256;

/// One task's counts with all of a state's side by side, so that a state that is drawn is added in one go:
/// [states][points][real successes, real trials, sim successes, sim trials]. Memory decides how fast this is: a Cell is
/// 16 bits where every count fits a byte, else 64.
template <typename Cell>
class StateRows {
 public:
  explicit StateRows(const TaskOutcomes& task) : columns_(4 * task.points.size()), states_(StatesOf(task)) {
    cells_.reserve(columns_ * states_);
    for (std::size_t state = 0; state < states_; ++state) {
      for (const PointOutcomes& point : task.points) {
        const Count &real = point.real[state], &sim = point.sim[state];
        for (const std::int64_t count : {real.successes, real.trials, sim.successes, sim.trials})
          cells_.push_back(static_cast<Cell>(count));
      }
    }
  }
  std::size_t states() const { return states_; }
  std::size_t columns() const { return columns_; }

  /// totals += sign * the state's row.
  void Add(std::size_t state, std::int64_t sign, std::span<std::int64_t> totals) const {
    const Cell* row = cells_.data() + state * columns_;
    for (std::size_t i = 0; i < columns_; ++i) totals[i] += sign * static_cast<std::int64_t>(row[i]);
  }
  /// The same for many, each as often as it is listed.
  void AddAll(std::span<const std::size_t> states, std::span<std::int64_t> totals) const {
    std::vector<Cell> sums(columns_);
    for (; !states.empty(); states = states.subspan(std::min(kBlock, states.size()))) {
      std::ranges::fill(sums, Cell{0});
      for (const std::size_t state : states.first(std::min(kBlock, states.size()))) {
        const Cell* row = cells_.data() + state * columns_;
        Cell* sum = sums.data();
        for (std::size_t i = 0; i < columns_; ++i) sum[i] = static_cast<Cell>(sum[i] + row[i]);
      }
      for (std::size_t i = 0; i < columns_; ++i) totals[i] += static_cast<std::int64_t>(sums[i]);
    }
  }

 private:
  std::size_t columns_, states_;
  std::vector<Cell> cells_;
};

bool FitsAByte(const std::vector<TaskOutcomes>& tasks) {
  constexpr std::int64_t kMost = std::numeric_limits<std::uint8_t>::max();
  const auto fits = [](const Count& count) { return count.successes <= kMost && count.trials <= kMost; };
  for (const TaskOutcomes& task : tasks) {
    for (const PointOutcomes& point : task.points) {
      if (!std::ranges::all_of(point.real, fits) || !std::ranges::all_of(point.sim, fits)) return false;
    }
  }
  return true;
}

/// Sums over the states taken: [tasks][points][4].
using Totals = std::vector<std::vector<std::int64_t>>;

template <typename Cell>
std::vector<StateRows<Cell>> RowsOf(const std::vector<TaskOutcomes>& tasks) {
  return {tasks.begin(), tasks.end()};
}

template <typename Cell>
Totals EachOnce(const std::vector<StateRows<Cell>>& tasks) {
  Totals totals;
  for (const StateRows<Cell>& task : tasks) {
    std::vector<std::int64_t>& sums = totals.emplace_back(task.columns(), 0);
    for (std::size_t state = 0; state < task.states(); ++state) task.Add(state, 1, sums);
  }
  return totals;
}

/// As many draws per task as it has states.
template <typename Cell>
Totals Draw(const std::vector<StateRows<Cell>>& tasks, SplitMix64& random) {
  Totals totals;
  std::vector<std::size_t> drawn;
  for (const StateRows<Cell>& task : tasks) {
    drawn.resize(task.states());
    for (std::size_t& state : drawn) state = random.Below(task.states());
    task.AddAll(drawn, totals.emplace_back(task.columns(), 0));
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

template <typename Cell>
ResampledRates Resample(const std::vector<TaskOutcomes>& outcomes, const BootstrapOptions& options) {
  const std::vector<StateRows<Cell>> tasks = RowsOf<Cell>(outcomes);
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
      tasks[task].Add(state, -1, totals[task]);
      RatePairs rates = RatesOfTotals(totals);
      tasks[task].Add(state, 1, totals[task]);
      if (rates.real.size() == result.all.real.size()) result.jackknife.push_back(std::move(rates));
    }
  }
  return result;
}

/// A state drawn again from one is the same state: every replicate would be the estimate, and the interval of no width.
std::string WhyNotResampled(const std::vector<TaskOutcomes>& tasks) {
  for (const TaskOutcomes& task : tasks) {
    if (!task.points.empty() && StatesOf(task) < kMinBootstrapStates)
      return fmt::format("{} initial state{} of a task, wanted at least {} to draw from", StatesOf(task),
                         StatesOf(task) == 1 ? "" : "s", kMinBootstrapStates);
  }
  return "";
}

/// In how many states each point was tried, in the order of the rates.
RatePairs StatesTried(const std::vector<TaskOutcomes>& tasks) {
  const auto tried = [](const std::vector<Count>& world) {
    return static_cast<double>(std::ranges::count_if(world, [](const Count& count) { return count.trials > 0; }));
  };
  RatePairs states;
  for (const TaskOutcomes& task : tasks) {
    for (const PointOutcomes& point : task.points) {
      const double real = tried(point.real), sim = tried(point.sim);
      if (real == 0 || sim == 0) continue;
      states.real.push_back(real);
      states.sim.push_back(sim);
    }
  }
  return states;
}

/// What no draw from these states can show.
struct Unseen {
  RatePairs rates;
  RatePairs tried;  ///< initial states, of each
};

/// The world's rates as they are, and with one that is 0 or 1 moved as far as its states leave open, each in turn.
std::vector<std::vector<double>> Moved(const std::vector<double>& rates, const std::vector<double>& tried,
                                       double tail) {
  std::vector<std::vector<double>> ways{rates};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    if (rates[i] != 0 && rates[i] != 1) continue;
    const double open = 1 - std::pow(tail, 1 / tried[i]);
    ways.emplace_back(rates)[i] = rates[i] == 0 ? open : 1 - open;
  }
  return ways;
}

Interval WithUnseen(Interval interval, const Unseen& unseen, const Statistic& statistic, double tail) {
  const std::vector<std::vector<double>> sim_ways = Moved(unseen.rates.sim, unseen.tried.sim, tail);
  for (const std::vector<double>& real : Moved(unseen.rates.real, unseen.tried.real, tail)) {
    for (const std::vector<double>& sim : sim_ways) {
      const Number value = statistic({.real = real, .sim = sim});
      if (value) interval = {std::min(interval.low, *value), std::max(interval.high, *value)};
    }
  }
  return interval;
}

IntervalAt IntervalOfRecord(const BootstrapOf& bootstrap, const Unseen& unseen, const Statistic& statistic) {
  return [resampled = bootstrap.resampled, dropped = bootstrap.undefined, unseen,
          statistic](double confidence) -> Defined<Interval> {
    const std::int64_t drawn = dropped + std::ssize(resampled.replicates);
    if (static_cast<double>(dropped) > (1 - confidence) * static_cast<double>(drawn))
      return Undefined{fmt::format("{} of {} replicates have none: where they would lie nobody knows", dropped, drawn)};
    const Defined<Interval> percentile = IntervalsOf(resampled, confidence).percentile;
    const auto [least, most] = std::ranges::minmax(resampled.replicates);
    return least < most ? percentile : WithUnseen(*percentile, unseen, statistic, (1 - confidence) / 2);
  };
}

std::string WhyNotAsDrawn(const BootstrapOf& bootstrap, double confidence) {
  const Defined<Interval> shown = bootstrap.of_record(confidence);
  if (!shown) return shown.reason();
  const Interval& drawn = *bootstrap.intervals.percentile;
  return shown->low == drawn.low && shown->high == drawn.high ? "" : "no replicate differs";
}

Defined<BootstrapOf> Bootstrap(const ResampledRates& rates, const RatePairs& tried, const Statistic& statistic,
                               double confidence) {
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
  result.of_record = IntervalOfRecord(result, {rates.all, tried}, statistic);
  result.not_as_drawn = WhyNotAsDrawn(result, confidence);
  return result;
}

}  // namespace

RatePairs RatesOf(const std::vector<TaskOutcomes>& tasks) {
  return RatesOfTotals(EachOnce(RowsOf<std::int64_t>(tasks)));
}

PairedBootstrap PairedStateBootstrap(const std::vector<TaskOutcomes>& tasks, const MmrvConvention& convention,
                                     const BootstrapOptions& options) {
  Check(tasks, options);
  PairedBootstrap result;
  result.method = fmt::format("paired state bootstrap, percentile, B={}, seed {}", options.replicates, options.seed);
  if (const std::string reason = WhyNotResampled(tasks); !reason.empty()) {
    result.pearson = result.spearman = result.mmrv = Undefined{reason};
    return result;
  }
  const ResampledRates rates =
      FitsAByte(tasks) ? Resample<std::uint16_t>(tasks, options) : Resample<std::int64_t>(tasks, options);
  const RatePairs tried = StatesTried(tasks);
  const auto bootstrap = [&](const Statistic& statistic) {
    return Bootstrap(rates, tried, statistic, options.confidence);
  };
  result.pearson = bootstrap([](const RatePairs& pairs) { return Pearson(pairs.sim, pairs.real).value; });
  result.spearman = bootstrap([](const RatePairs& pairs) { return Spearman(pairs.sim, pairs.real).value; });
  result.mmrv = bootstrap([convention](const RatePairs& pairs) { return Mmrv(pairs, convention).mmrv; });
  return result;
}

}  // namespace evac
