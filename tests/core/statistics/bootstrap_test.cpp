#include "core/statistics/bootstrap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/association.h"
#include "core/statistics/paired_bootstrap.h"

namespace evac {
namespace {

constexpr BootstrapOptions kFew = {.replicates = 300, .seed = 5, .confidence = 0.95};

/// Policies of rising skill; in both worlds a state is easy or hard for all.
TaskOutcomes RandomTask(std::uint64_t seed, int policies, int states) {
  SplitMix64 random(seed);
  TaskOutcomes task;
  std::vector<double> difficulty;
  for (int s = 0; s < states; ++s) difficulty.push_back(random.Uniform());
  for (int p = 0; p < policies; ++p) {
    PointOutcomes& point = task.points.emplace_back();
    const double skill = (p + 1.0) / (policies + 1.0);
    for (int s = 0; s < states; ++s) {
      point.real.push_back({random.Uniform() + skill > difficulty[s] + 0.4, 1});
      point.sim.push_back({random.Uniform() + skill > difficulty[s] + 0.4, 1});
    }
  }
  return task;
}

TEST(Quantile, IsTheOrderStatisticAtWholePlacesAndLinearBetweenThem) {
  const std::vector<double> sorted = {1, 2, 4, 8};
  EXPECT_EQ(Quantile(sorted, 0), 1);
  EXPECT_EQ(Quantile(sorted, 1), 8);
  EXPECT_NEAR(Quantile(sorted, 1.0 / 3), 2, 1e-12);
  EXPECT_NEAR(Quantile(sorted, 0.5), 3, 1e-12);
  EXPECT_EQ(Quantile(std::vector<double>{7}, 0.3), 7);
  EXPECT_THROW(Quantile({}, 0.5), Error);
  EXPECT_THROW(Quantile(sorted, 1.1), Error);
}

TEST(Bootstrap, AStatisticThatNeverScattersHasAnIntervalOfNoWidth) {
  const BootstrapIntervals intervals = IntervalsOf({0.5, std::vector<double>(100, 0.5), {0.5, 0.5, 0.5}});
  EXPECT_EQ(intervals.percentile->low, 0.5);
  EXPECT_EQ(intervals.percentile->high, 0.5);
  EXPECT_EQ(*intervals.z0, 0);
  EXPECT_EQ(*intervals.acceleration, 0);
  EXPECT_EQ(intervals.bca->low, 0.5);
  EXPECT_EQ(intervals.bca->high, 0.5);
}

TEST(Bootstrap, WhatCannotBeCorrectedIsUndefined) {
  EXPECT_EQ(IntervalsOf({0.5, {}, {}}).percentile.reason(), "no replicates");
  const BootstrapIntervals one_sided = IntervalsOf({0.5, {0.6, 0.7, 0.8}, {0.4, 0.5}});
  EXPECT_TRUE(one_sided.percentile);
  EXPECT_EQ(one_sided.bca.reason(), "all replicates lie on one side of the estimate");
  EXPECT_FALSE(IntervalsOf({0.5, {0.4, 0.6}, {}}).bca);
  EXPECT_THROW(IntervalsOf({0.5, {0.4, 0.6}, {}}, 1.0), Error);
}

TEST(ClusterBootstrap, RefusesNothingToDrawFrom) {
  EXPECT_THROW(ClusterBootstrapRate({}), Error);
  EXPECT_THROW(ClusterBootstrapRate(std::vector<Count>{{1, 2}}, {.replicates = 0}), Error);
}

TEST(PairedStateBootstrap, IsTheSameForTheSameSeedAndStaysInRange) {
  const std::vector<TaskOutcomes> tasks = {RandomTask(1, 4, 12), RandomTask(2, 3, 9)};
  const PairedBootstrap one = PairedStateBootstrap(tasks, {}, kFew), again = PairedStateBootstrap(tasks, {}, kFew);
  EXPECT_EQ(one.pearson->resampled.replicates, again.pearson->resampled.replicates);
  EXPECT_EQ(one.mmrv->resampled.replicates, again.mmrv->resampled.replicates);
  for (const Defined<BootstrapOf>& correlation : {one.pearson, one.spearman}) {
    for (const double r : correlation->resampled.replicates) EXPECT_LE(std::abs(r), 1);
    EXPECT_LE(-1, correlation->intervals.percentile->low);
    EXPECT_LE(correlation->intervals.percentile->low, correlation->intervals.percentile->high);
    EXPECT_LE(correlation->intervals.percentile->high, 1);
  }
  EXPECT_GE(one.mmrv->intervals.percentile->low, 0);
  EXPECT_EQ(one.method, "paired state bootstrap, percentile, B=300, seed 5");
}

/// Few trials per state are summed in narrow numbers, many in wide ones.
TEST(PairedStateBootstrap, AThousandTimesAsManyTrialsGiveTheSameReplicates) {
  TaskOutcomes narrow = RandomTask(8, 4, 600), wide = narrow;  // more states than one block of sums
  for (PointOutcomes& point : wide.points) {
    for (std::vector<Count>* world : {&point.real, &point.sim}) {
      for (Count& count : *world) count = {1000 * count.successes, 1000 * count.trials};
    }
  }
  const PairedBootstrap one = PairedStateBootstrap({narrow}, {}, kFew), thousand = PairedStateBootstrap({wide}, {}, kFew);
  EXPECT_EQ(one.pearson->resampled.replicates, thousand.pearson->resampled.replicates);
  EXPECT_EQ(one.pearson->resampled.jackknife, thousand.pearson->resampled.jackknife);
}

TEST(PairedStateBootstrap, TwoWorldsThatNeverDisagreeCorrelatePerfectlyInEveryReplicate) {
  TaskOutcomes task = RandomTask(3, 5, 20);
  for (PointOutcomes& point : task.points) point.sim = point.real;
  const PairedBootstrap bootstrap = PairedStateBootstrap({task}, {}, kFew);
  EXPECT_EQ(bootstrap.pearson->intervals.percentile->low, 1);
  EXPECT_EQ(bootstrap.mmrv->intervals.percentile->high, 0);
}

/// A report of one state a task once said "follows closely: Pearson 0.76 [0.76, 0.76]".
TEST(PairedStateBootstrap, OneInitialStateOfATaskGivesNoInterval) {
  for (const std::vector<TaskOutcomes>& tasks :
       {std::vector{RandomTask(3, 5, 1)}, std::vector{RandomTask(3, 5, 20), RandomTask(4, 5, 1)}}) {
    const PairedBootstrap bootstrap = PairedStateBootstrap(tasks, {}, kFew);
    EXPECT_EQ(bootstrap.pearson.reason(), "1 initial state of a task, wanted at least 2 to draw from");
    EXPECT_FALSE(bootstrap.spearman);
    EXPECT_FALSE(bootstrap.mmrv);
  }
  EXPECT_TRUE(PairedStateBootstrap({RandomTask(3, 5, 2)}, {}, kFew).mmrv);
}

/// `policies` that succeed in every one of `states` in both worlds, the last but for its first `failures`.
TaskOutcomes NearlyPerfect(std::size_t policies, std::size_t states, std::size_t failures) {
  TaskOutcomes task;
  for (std::size_t p = 0; p < policies; ++p) {
    PointOutcomes& point = task.points.emplace_back();
    for (std::size_t s = 0; s < states; ++s) point.real.push_back({p + 1 < policies || s >= failures, 1});
    point.sim = point.real;
  }
  return task;
}

/// Two states in which two policies succeed in both worlds rank nothing; it was MMRV 0 [0, 0], and a gate passed.
TEST(PairedStateBootstrap, WhereNoReplicateDiffersItsIntervalHoldsWhatTheStatesLeaveOpen) {
  const auto high = [](std::size_t states, double confidence) {
    const PairedBootstrap bootstrap = PairedStateBootstrap({NearlyPerfect(2, states, 0)}, {}, kFew);
    EXPECT_EQ(bootstrap.mmrv->intervals.percentile->high, 0);
    EXPECT_EQ(bootstrap.mmrv->not_as_drawn, "no replicate differs");
    EXPECT_EQ(bootstrap.mmrv->of_record(confidence)->low, 0);
    return bootstrap.mmrv->of_record(confidence)->high;
  };
  EXPECT_NEAR(high(2, 0.9), 1 - std::sqrt(0.05), 1e-12) << "one policy may fail in 78 % of such states";
  EXPECT_NEAR(high(40, 0.9), 1 - std::pow(0.05, 1.0 / 40), 1e-12);
  EXPECT_GT(high(40, 0.99), high(40, 0.9));
}

TEST(PairedStateBootstrap, ItsIntervalOfRecordIsThePercentileIntervalWhereReplicatesDifferOrNothingIsAllAlike) {
  const PairedBootstrap ordinary = PairedStateBootstrap({RandomTask(4, 4, 20)}, {}, kFew);
  for (const Defined<BootstrapOf>& one : {ordinary.pearson, ordinary.spearman, ordinary.mmrv}) {
    EXPECT_EQ(one->of_record(0.95)->low, one->intervals.percentile->low);
    EXPECT_EQ(one->of_record(0.95)->high, one->intervals.percentile->high);
    EXPECT_EQ(one->not_as_drawn, "");
  }
  TaskOutcomes copy;  // rates 1/2, 1/4 and 3/4: the worlds agreed in every state
  for (const std::size_t period : {2, 4, 1}) {
    PointOutcomes& point = copy.points.emplace_back();
    for (std::size_t s = 0; s < 16; ++s) point.real.push_back({period == 1 ? s % 4 != 0 : s % period == 0, 1});
    point.sim = point.real;
  }
  EXPECT_EQ(PairedStateBootstrap({copy}, {}, kFew).pearson->of_record(0.95)->low, 1);
}

/// One failure of twenty decides in a third of the replicates that there is no correlation at all; the others say 1.
TEST(PairedStateBootstrap, WhereTooManyReplicatesAreDroppedNobodyKnowsWhereTheyWouldLie) {
  const PairedBootstrap bootstrap = PairedStateBootstrap({NearlyPerfect(3, 20, 1)}, {}, kFew);
  ASSERT_GT(bootstrap.pearson->undefined, 60);
  EXPECT_EQ(bootstrap.pearson->intervals.percentile->low, 1);
  EXPECT_FALSE(bootstrap.pearson->of_record(0.95));
  EXPECT_EQ(bootstrap.pearson->of_record(0.9).reason(),
            std::to_string(bootstrap.pearson->undefined) +
                " of 300 replicates have none: where they would lie nobody knows");
  EXPECT_EQ(bootstrap.pearson->not_as_drawn, bootstrap.pearson->of_record(0.95).reason());
  EXPECT_TRUE(bootstrap.pearson->of_record(0.2)) << "which leaves four fifths outside";
}

TEST(PairedStateBootstrap, ItsThetaIsTheStatisticOfTheRates) {
  const std::vector<TaskOutcomes> tasks = {RandomTask(4, 3, 7), RandomTask(5, 3, 11)};
  const RatePairs rates = RatesOf(tasks);
  ASSERT_EQ(rates.real.size(), 6u);
  const PairedBootstrap bootstrap = PairedStateBootstrap(tasks, {}, kFew);
  EXPECT_EQ(bootstrap.pearson->resampled.theta, *Pearson(rates.sim, rates.real).value);
  EXPECT_EQ(bootstrap.mmrv->resampled.theta, *Mmrv(rates).mmrv);
  EXPECT_EQ(bootstrap.pearson->resampled.jackknife.size(), 18u);
}

TEST(PairedStateBootstrap, DropsAndCountsReplicatesWhereTheStatisticIsUndefined) {
  TaskOutcomes task;  // one state decides everything: without it all real rates are 0
  task.points = {{.real = {{1, 1}, {0, 1}, {0, 1}}, .sim = {{1, 1}, {0, 1}, {1, 1}}},
                 {.real = {{0, 1}, {0, 1}, {0, 1}}, .sim = {{0, 1}, {1, 1}, {0, 1}}},
                 {.real = {{0, 1}, {0, 1}, {0, 1}}, .sim = {{0, 1}, {0, 1}, {0, 1}}}};
  const PairedBootstrap bootstrap = PairedStateBootstrap({task}, {}, kFew);
  EXPECT_GT(bootstrap.pearson->undefined, 0);
  EXPECT_EQ(bootstrap.pearson->undefined + static_cast<std::int64_t>(bootstrap.pearson->resampled.replicates.size()),
            300);
  EXPECT_EQ(bootstrap.mmrv->undefined, 0);
}

TEST(PairedStateBootstrap, CountsAReplicateThatLostAPointAsUndefined) {
  TaskOutcomes task = RandomTask(6, 4, 6);
  for (std::size_t state = 1; state < 6; ++state) task.points[0].real[state] = task.points[0].sim[state] = {0, 0};
  const PairedBootstrap bootstrap = PairedStateBootstrap({task}, {}, kFew);
  EXPECT_GT(bootstrap.mmrv->undefined, 0);
  EXPECT_EQ(RatesOf({task}).real.size(), 4u);
}

TEST(PairedStateBootstrap, SaysWhyThereIsNothingAndRefusesStatesThatDoNotMatch) {
  EXPECT_EQ(PairedStateBootstrap({}).pearson.reason(), "no points");
  TaskOutcomes task = RandomTask(7, 3, 5);
  task.points[1].sim.pop_back();
  EXPECT_THROW(PairedStateBootstrap({task}), Error);
  EXPECT_THROW(PairedStateBootstrap({}, {}, {.replicates = 0}), Error);
}

}  // namespace
}  // namespace evac
