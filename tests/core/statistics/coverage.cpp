#include "tests/core/statistics/coverage.h"

#include <fmt/format.h>

#include <functional>
#include <span>

#include "core/seed.h"
#include "core/statistics/association.h"
#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/paired_bootstrap.h"
#include "core/statistics/ppi.h"
#include "core/statistics/rate_difference.h"

namespace evac::coverage {
namespace {

constexpr int kSizes[] = {10, 20, 40, 100};

bool Flip(SplitMix64& random, double p) { return random.Uniform() < p; }

Count Draw(SplitMix64& random, int n, double p) {
  Count count{0, n};
  for (int i = 0; i < n; ++i) count.successes += Flip(random, p);
  return count;
}

/// Gathers one method's intervals over the replicates.
class Tally {
 public:
  explicit Tally(std::string method) { coverage_.method = std::move(method); }
  void Add(const Defined<Interval>& interval, double truth) {
    if (!interval) {
      ++coverage_.without;
      return;
    }
    ++intervals_;
    covered_ += interval->low <= truth && truth <= interval->high;
    width_ += interval->high - interval->low;
  }
  Coverage Result() const {
    Coverage result = coverage_;
    if (intervals_ > 0) result.share = covered_ / intervals_;
    if (intervals_ > 0) result.mean_width = width_ / intervals_;
    return result;
  }

 private:
  Coverage coverage_;
  double intervals_ = 0, covered_ = 0, width_ = 0;
};

/// Runs `replicate(random, tallies)` as often as asked. Every row has its own random numbers.
Row Simulate(Row row, const std::vector<std::string>& methods, const SimulationOptions& options,
             const std::function<void(SplitMix64&, std::span<Tally>)>& replicate) {
  std::vector<Tally> tallies;
  for (const std::string& method : methods) tallies.emplace_back(method);
  SplitMix64 random(SeedFor(options.seed, fmt::format("{} {}", row.setting, row.n)));
  for (int i = 0; i < options.replicates; ++i) replicate(random, tallies);
  for (const Tally& tally : tallies) row.methods.push_back(tally.Result());
  return row;
}

struct FlipSetting {
  double both, only_first, only_second;
};

PairedOutcomes DrawPairs(SplitMix64& random, int n, const FlipSetting& setting) {
  PairedOutcomes outcomes{{}, n};
  for (int i = 0; i < n; ++i) {
    const double u = random.Uniform();
    outcomes.flips.only_first += u < setting.only_first;
    outcomes.flips.only_second += u >= setting.only_first && u < setting.only_first + setting.only_second;
  }
  return outcomes;
}

/// A share of the states is hard to judge; half of all clips are successes, those of one state mostly alike.
constexpr double kErrsElsewhere = 0.03;
struct JudgeSetting {
  int clips;
  double hard, errs_there;

  double Errs() const { return hard * errs_there + (1 - hard) * kErrsElsewhere; }
  double Kappa() const { return 1 - 2 * Errs(); }
  std::string Text(const std::string& truth) const {
    return fmt::format("{} a state, true {}, errs in {} of the states {} of the time",
                       clips == 1 ? "1 clip" : std::to_string(clips) + " clips", truth, hard, errs_there);
  }
};
constexpr JudgeSetting kJudges[] = {{1, .2, .5}, {5, .2, .5}, {5, .1, .9}, {10, .1, .9}};

ConfusionByState DrawStates(SplitMix64& random, int n, const JudgeSetting& setting) {
  ConfusionByState states;
  for (int i = 0; i < n; ++i) {
    const bool succeeds = Flip(random, 0.5), is_hard = Flip(random, setting.hard);
    Confusion& state = states[{"", std::to_string(i)}];
    for (int clip = 0; clip < setting.clips; ++clip) {
      const bool is = succeeds != Flip(random, 0.2);
      state.Add(is != Flip(random, is_hard ? setting.errs_there : kErrsElsewhere), is);
    }
  }
  return states;
}

/// The same judge, who is sure of each verdict to .9.
constexpr double kSure = 0.9;
StatedByState Stated(const ConfusionByState& states) {
  StatedByState stated;
  for (const auto& [state, c] : states) {
    std::vector<StatedProbability>& items = stated[state];
    items.insert(items.end(), static_cast<std::size_t>(c.both_success), {kSure, true});
    items.insert(items.end(), static_cast<std::size_t>(c.only_judge_success), {kSure, false});
    items.insert(items.end(), static_cast<std::size_t>(c.only_human_success), {1 - kSure, true});
    items.insert(items.end(), static_cast<std::size_t>(c.both_failure), {1 - kSure, false});
  }
  return stated;
}

/// Real outcomes with rate p; the model says the same with probability `agreement`.
struct FewRealSetting {
  int n;
  double p, agreement;
};

void FewRealReplicate(SplitMix64& random, const FewRealSetting& setting, std::span<Tally> tallies) {
  std::vector<BothOutcomes> paired;
  std::vector<bool> more;
  Count real{0, setting.n}, imagined{0, 10 * setting.n};
  for (int i = 0; i < setting.n; ++i) {
    const bool y = Flip(random, setting.p);
    paired.push_back({y, y == Flip(random, setting.agreement)});
    real.successes += y;
  }
  for (int i = 0; i < 10 * setting.n; ++i) {
    more.push_back(Flip(random, setting.p) == Flip(random, setting.agreement));
    imagined.successes += more.back();
  }
  const BothWorlds table = TableOf(paired);
  tallies[0].Add(WilsonInterval(real.successes, real.trials).interval, setting.p);
  tallies[1].Add(PpiMean(table, imagined, PpiWeight::kTuned).normal, setting.p);
  tallies[2].Add(PpiMover(table, imagined).interval, setting.p);
  tallies[3].Add(PpiBetting(paired, more, {.seed = random.Next()}).interval, setting.p);
}

/// Six policies; whether one succeeds in a state hangs on the policy's rate and on how hard the state is, and the model
/// keeps the state's difficulty but is wrong now and then.
constexpr double kPolicyRates[] = {0.15, 0.3, 0.45, 0.6, 0.75, 0.9};
constexpr double kModelBias[] = {0.05, -0.1, 0.1, 0.0, -0.05, 0.05};

TaskOutcomes DrawTask(SplitMix64& random, int states) {
  TaskOutcomes task;
  task.points.resize(std::size(kPolicyRates));
  for (int state = 0; state < states; ++state) {
    const double difficulty = random.Uniform();
    for (std::size_t policy = 0; policy < task.points.size(); ++policy) {
      const double real = kPolicyRates[policy], model = real + kModelBias[policy];
      // Half of what decides is shared between worlds and policies: a hard state is hard for all.
      const auto succeeds = [&](double rate) { return (Flip(random, 0.5) ? difficulty : random.Uniform()) < rate; };
      task.points[policy].real.push_back({succeeds(real), 1});
      task.points[policy].sim.push_back({succeeds(model), 1});
    }
  }
  return task;
}

double TruePearson() {
  std::vector<double> real(std::begin(kPolicyRates), std::end(kPolicyRates)), model;
  for (std::size_t i = 0; i < real.size(); ++i) model.push_back(real[i] + kModelBias[i]);
  return *Pearson(model, real).value;
}

/// The mean r of samples of this size: what noise in the rates leaves of the true one.
double MeanPearson(int states) {
  SplitMix64 random(SeedFor(7, static_cast<std::uint64_t>(states)));
  double sum = 0, defined = 0;
  for (int i = 0; i < 4000; ++i) {
    const RatePairs rates = RatesOf({DrawTask(random, states)});
    if (const Number r = Pearson(rates.sim, rates.real).value) {
      sum += *r;
      ++defined;
    }
  }
  return sum / defined;
}

}  // namespace

std::vector<Row> Rates(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    for (const double p : {0.5, 0.7, 0.9, 0.95}) {
      const auto replicate = [&](SplitMix64& random, std::span<Tally> tallies) {
        const Count count = Draw(random, n, p);
        tallies[0].Add(WilsonInterval(count.successes, n).interval, p);
        tallies[1].Add(ClopperPearsonInterval(count.successes, n).interval, p);
        tallies[2].Add(JeffreysInterval(count.successes, n).interval, p);
      };
      rows.push_back(
          Simulate({fmt::format("p {}", p), n, {}}, {"Wilson", "Clopper-Pearson", "Jeffreys"}, options, replicate));
    }
  }
  return rows;
}

std::vector<Row> Differences(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    for (const FlipSetting& setting : {FlipSetting{.6, .1, .1}, {.5, .25, .05}, {.9, .05, .0}, {.2, .3, .3}}) {
      const double difference = setting.only_first - setting.only_second;
      const double first = setting.both + setting.only_first, second = setting.both + setting.only_second;
      const auto replicate = [&](SplitMix64& random, std::span<Tally> tallies) {
        const PairedOutcomes outcomes = DrawPairs(random, n, setting);
        tallies[0].Add(TangoDifference(outcomes).interval, difference);
        tallies[1].Add(BonettPriceDifference(outcomes).interval, difference);
        tallies[2].Add(NewcombeDifference(Draw(random, n, first), Draw(random, n, second)).interval, difference);
      };
      rows.push_back(Simulate(
          {fmt::format("{} against {}, flips {} / {}", first, second, setting.only_first, setting.only_second), n, {}},
          {"Tango (paired)", "Bonett-Price (paired)", "Newcombe (unpaired)"}, options, replicate));
    }
  }
  return rows;
}

std::vector<Row> Kappas(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    for (const JudgeSetting& setting : kJudges) {
      const double kappa = setting.Kappa();
      const auto replicate = [&](SplitMix64& random, std::span<Tally> tallies) {
        const ConfusionByState states = DrawStates(random, n, setting);
        tallies[0].Add(StatisticsByState(states).kappa.interval, kappa);
        tallies[1].Add(StatisticsOf(SumOf(states)).kappa.interval, kappa);
      };
      rows.push_back(Simulate({setting.Text(fmt::format("kappa {:.2f}", kappa)), n, {}},
                              {"by state", "Fleiss-Cohen-Everitt"}, options, replicate));
    }
  }
  return rows;
}

std::vector<Row> SensitivitiesAndBriers(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    for (const JudgeSetting& setting : kJudges) {
      const double sensitivity = 1 - setting.Errs();
      const double brier = (1 - kSure) * (1 - kSure) * (1 - setting.Errs()) + kSure * kSure * setting.Errs();
      const auto replicate = [&](SplitMix64& random, std::span<Tally> tallies) {
        const ConfusionByState states = DrawStates(random, n, setting);
        tallies[0].Add(StatisticsByState(states).sensitivity.interval, sensitivity);
        tallies[1].Add(StatisticsOf(SumOf(states)).sensitivity.interval, sensitivity);
        tallies[2].Add(CalibrationByState(Stated(states)).brier.interval, brier);
      };
      rows.push_back(Simulate({setting.Text(fmt::format("{:.2f} and {:.2f}", sensitivity, brier)), n, {}},
                              {"sensitivity by state", "sensitivity, Wilson", "Brier by state"}, options, replicate));
    }
  }
  return rows;
}

std::vector<Row> FewReal(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    for (const auto& [p, agreement] : {std::pair{.5, .9}, {.7, .9}, {.9, .9}, {.95, .95}, {.7, .7}}) {
      const FewRealSetting setting{n, p, agreement};
      rows.push_back(
          Simulate({fmt::format("p {}, agreement {}", p, agreement), n, {}},
                   {"Wilson, real only", "PPI++ normal", "MOVER", "betting"}, options,
                   [&](SplitMix64& random, std::span<Tally> tallies) { FewRealReplicate(random, setting, tallies); }));
    }
  }
  return rows;
}

std::vector<Row> Bootstrap(const SimulationOptions& options) {
  std::vector<Row> rows;
  for (const int n : kSizes) {
    const double truth = TruePearson(), typical = MeanPearson(n);
    const auto replicate = [&](SplitMix64& random, std::span<Tally> tallies) {
      const PairedBootstrap bootstrap =
          PairedStateBootstrap({DrawTask(random, n)}, {}, {.replicates = 500, .seed = random.Next()});
      if (!bootstrap.pearson) return;
      tallies[0].Add(bootstrap.pearson->intervals.percentile, truth);
      tallies[1].Add(bootstrap.pearson->intervals.bca, truth);
      tallies[2].Add(bootstrap.pearson->intervals.percentile, typical);
    };
    rows.push_back(Simulate({fmt::format("true r {:.3f}, mean r of such samples {:.3f}", truth, typical), n, {}},
                            {"percentile, of the true r", "BCa, of the true r", "percentile, of the mean r"}, options,
                            replicate));
  }
  return rows;
}

}  // namespace evac::coverage
