#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/betting.h"
#include "core/statistics/planning.h"
#include "core/statistics/ppi.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/sequential.h"
#include "core/statistics/sequential_planning.h"

namespace evac {
namespace {

TEST(Betting, TheMirroredValuesHaveTheMirroredInterval) {
  const std::vector<double> values{0.2, 0.9, 0.4, 0.4, 1, 0, 0.7};
  std::vector<double> mirrored;
  for (const double value : values) mirrored.push_back(1 - value);
  const Interval one = *BettingInterval(values).interval, other = *BettingInterval(mirrored).interval;
  EXPECT_NEAR(one.low, 1 - other.high, 1e-12);
  EXPECT_NEAR(one.high, 1 - other.low, 1e-12);
}

TEST(Betting, EdgesAreAnsweredAndNonsenseIsRefused) {
  EXPECT_FALSE(BettingInterval({}).value);
  EXPECT_EQ(BettingInterval({}).interval->high, 1);
  const std::vector<double> ones(30, 1.0), zeros(30, 0.0);
  EXPECT_EQ(BettingInterval(ones).interval->high, 1);
  EXPECT_GT(BettingInterval(ones).interval->low, 0.7);
  EXPECT_EQ(BettingInterval(zeros).interval->low, 0);
  EXPECT_THROW(BettingInterval(std::vector{1.5}), Error);
  EXPECT_THROW(BettingInterval(ones, {.confidence = 1}), Error);
  EXPECT_THROW(BettingInterval(ones, {.truncation = 0}), Error);
}

TEST(Betting, AShuffleKeepsTheValuesAndDependsOnTheSeedAlone) {
  const std::vector<double> values{1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_THAT(SeededShuffle(values, 4), testing::UnorderedElementsAreArray(values));
  EXPECT_EQ(SeededShuffle(values, 4), SeededShuffle(values, 4));
  EXPECT_NE(SeededShuffle(values, 4), SeededShuffle(values, 5));
}

TEST(Ppi, TheNormalIntervalMayOnlyBeShownWhereItCovers) {
  const Count more{1290, 2000};
  EXPECT_TRUE(PpiMean({22, 3, 4, 11}, more, PpiWeight::kTuned).allowed);
  EXPECT_FALSE(PpiMean({11, 3, 4, 11}, more, PpiWeight::kTuned).allowed) << "29 real trials";
  EXPECT_FALSE(PpiMean({25, 2, 2, 11}, more, PpiWeight::kTuned).allowed) << "4 pairs differ";
}

/// One outcome of each kind in a state of its own.
PpiStates OneEach(const BothWorlds& table, const Count& more) {
  PpiStates states;
  states.paired.insert(states.paired.end(), static_cast<std::size_t>(table.both), {1, 0, 0, 0});
  states.paired.insert(states.paired.end(), static_cast<std::size_t>(table.only_real), {0, 1, 0, 0});
  states.paired.insert(states.paired.end(), static_cast<std::size_t>(table.only_model), {0, 0, 1, 0});
  states.paired.insert(states.paired.end(), static_cast<std::size_t>(table.neither), {0, 0, 0, 1});
  for (std::int64_t i = 0; i < more.trials; ++i) states.more.push_back({i < more.successes ? 1 : 0, 1});
  return states;
}

TEST(PpiByState, OneOutcomeAStateIsAsTheTableAlone) {
  const BothWorlds table{22, 3, 4, 11};
  const Count more{129, 200};
  const PpiStates states = OneEach(table, more);
  const PpiEstimate alone = PpiMean(table, more, PpiWeight::kTuned), by_state = PpiMeanByState(states, PpiWeight::kTuned);
  EXPECT_EQ(*by_state.se, *alone.se);
  EXPECT_EQ(by_state.allowed->low, alone.allowed->low);
  EXPECT_EQ(PpiMoverByState(states).interval->low, PpiMover(table, more).interval->low);
}

/// What the robot does is the state's; the model errs here and there: Y - G shows no likeness within a state, Y is all alike.
TEST(PpiByState, RealTrialsThatRepeatTheirStateAreNotAsManyStates) {
  PpiStates states;
  for (int i = 0; i < 40; ++i) {
    const bool errs = i % 2 == 0;  // in one of five
    states.paired.push_back(i < 20 ? BothWorlds{errs ? 4 : 5, errs ? 1 : 0, 0, 0} : BothWorlds{0, 0, errs ? 1 : 0, errs ? 4 : 5});
  }
  for (int i = 0; i < 10; ++i) states.more.push_back({i % 2, 1});
  const PpiEstimate tuned = PpiMeanByState(states, PpiWeight::kTuned);
  EXPECT_LT(tuned.lambda, 0.1) << "ten further outcomes say little";
  EXPECT_NEAR(*tuned.se, std::sqrt(0.25 / 40), 0.008) << "forty states of which half succeed";
  EXPECT_LT(*PpiMean(states.Paired(), states.More(), PpiWeight::kTuned).se, 0.04) << "as two hundred trials";
  EXPECT_TRUE(tuned.allowed);
}

TEST(PpiByState, FurtherOutcomesThatRepeatTheirStateAreNotAsManyStates) {
  PpiStates once = OneEach({20, 3, 3, 20}, {100, 200}), often = once;
  for (Count& state : often.more) state = {state.successes * 10, state.trials * 10};
  const PpiEstimate one = PpiMeanByState(once, PpiWeight::kFull), ten = PpiMeanByState(often, PpiWeight::kFull);
  EXPECT_NEAR(*ten.value, *one.value, 1e-12);
  EXPECT_NEAR(*ten.se, *one.se, 0.001);
  EXPECT_NEAR(PpiMoverByState(often).interval->low, PpiMoverByState(once).interval->low, 0.002);
  often.more = {{5, 10}};
  EXPECT_EQ(PpiMeanByState(often, PpiWeight::kFull).se.reason(), "all further outcomes are of one initial state");
  EXPECT_NEAR(*PpiMoverByState(often).value, 0.5, 1e-12) << "ten outcomes of one state: half of them, not all";
}

TEST(PpiByState, FewStatesAreFewHoweverOftenTheyAreTried) {
  PpiStates states;
  for (int i = 0; i < 12; ++i) states.paired.push_back({4, 1, 0, 5});
  states.more = {{1, 1}, {0, 1}};
  EXPECT_EQ(PpiMeanByState(states, PpiWeight::kTuned).allowed.reason(), "fewer than 40 initial states tried for real");
  EXPECT_FALSE(PpiMeanByState({{{4, 1, 0, 5}}, {{1, 1}, {0, 1}}}, PpiWeight::kTuned).se);
}

/// All forty real trials succeed, so that the model's five failures explain nothing: weight 0, 100 % [100, 100].
TEST(Ppi, AnIntervalOfNoWidthIsNotAllowed) {
  const PpiEstimate tuned = PpiMean({35, 5, 0, 0}, {85, 100}, PpiWeight::kTuned);
  EXPECT_EQ(*tuned.value, 1);
  EXPECT_EQ(*tuned.se, 0);
  EXPECT_EQ(tuned.normal->low, 1) << "what other programs give";
  EXPECT_EQ(tuned.allowed.reason(), "the estimated spread is 0");
  PpiStates states;  // the same with two trials of each state
  for (int i = 0; i < 40; ++i) states.paired.push_back({i < 35 ? 2 : 0, i < 35 ? 0 : 2, 0, 0});
  states.more = {{8, 10}, {9, 10}};
  EXPECT_EQ(PpiMeanByState(states, PpiWeight::kTuned).allowed.reason(), "the estimated spread is 0");
}

TEST(Ppi, WithoutFurtherOutcomesTheRealTrialsStandAlone) {
  const PpiEstimate tuned = PpiMean({5, 1, 2, 2}, {0, 0}, PpiWeight::kTuned);
  EXPECT_EQ(tuned.lambda, 0);
  EXPECT_NEAR(*tuned.value, 0.6, 1e-12);
  EXPECT_FALSE(PpiMean({5, 1, 2, 2}, {0, 0}, PpiWeight::kFull).value);
  EXPECT_FALSE(PpiMover({5, 1, 2, 2}, {0, 0}).value);
  EXPECT_FALSE(PpiMover({}, {5, 9}).value);
  EXPECT_EQ(PpiMover({}, {5, 9}).interval->high, 1);
  EXPECT_FALSE(PpiBetting({}, {true}).value);
  EXPECT_THROW(PpiMean({-1, 0, 0, 2}, {0, 0}, PpiWeight::kTuned), Error);
}

TEST(Ppi, AModelThatIsAlwaysRightIsWorthItsTrials) {
  const Estimate few = WilsonInterval(30, 40), predicted = PpiMover({30, 0, 0, 10}, {1500, 2000});
  const double alone = few.interval->high - few.interval->low;
  EXPECT_LT(predicted.interval->high - predicted.interval->low, 0.75 * alone);
  EXPECT_NEAR(*predicted.value, 0.75, 1e-12);
}

TEST(Ppi, BettingDependsOnTheSeedOnlyAndStaysWithinTheUnitInterval) {
  const std::vector<BothOutcomes> paired(12, {true, true});
  const std::vector<bool> more(100, true);
  const Estimate one = PpiBetting(paired, more, {.seed = 3}), again = PpiBetting(paired, more, {.seed = 3});
  EXPECT_EQ(one.interval->low, again.interval->low);
  EXPECT_EQ(one.interval->high, 1);
  EXPECT_EQ(*one.value, 1);
}

TEST(Planning, TheNumbersOfThePaperReviewComeOut) {
  EXPECT_NEAR(WilsonHalfWidth(0.5, 40), 0.148, 5e-4);
  EXPECT_NEAR(WilsonHalfWidth(0.9, 40), 0.095, 1e-3);
  EXPECT_EQ(TrialsPerPolicy(0.5, 0.65).n, 170);
  EXPECT_EQ(TrialsPerPolicy(0.5, 0.8).n, 39);
  EXPECT_NEAR(*DetectableDifference(0.5, 40), 0.30, 0.01);
  EXPECT_NEAR(McNemarPower(40, {0.30, 0.05}), 0.74, 0.01);
  EXPECT_NEAR(McNemarPower(100, {0.20, 0.05}), 0.84, 0.01);
  EXPECT_NEAR(PanelOf(3, 0.9).majority_right, 0.972, 1e-3);
  EXPECT_NEAR(PanelOf(3, 0.9).split, 0.27, 1e-3);
}

TEST(Planning, TheSizeIsTheFirstThatIsEnough) {
  const std::int64_t n = TrialsForHalfWidth(0.3, 0.07);
  EXPECT_LE(WilsonHalfWidth(0.3, n), 0.07);
  EXPECT_GT(WilsonHalfWidth(0.3, n - 1), 0.07);
  const FlipRates rates{0.25, 0.05};
  const std::int64_t pairs = PairsForMcNemar(rates).n;
  EXPECT_GE(McNemarPower(pairs, rates), 0.8);
  EXPECT_LT(McNemarPower(pairs - 1, rates), 0.8);
  for (int more = 0; more < 20; ++more) EXPECT_GE(McNemarPower(pairs + more, rates), 0.8);
  EXPECT_EQ(RatersFor(0.9, 0.97), 3);
  EXPECT_EQ(RatersFor(0.9, 0.9), 1);
  EXPECT_EQ(RatersFor(0.5, 0.9), 0);
}

/// All 8 pairs must flip one way at alpha .01: 8 do in 82 % of cases, 9 to 11 more seldom, 12 may spare one.
TEST(Planning, APowerThatHoldsAndFallsAgainIsLookedForFurtherOn) {
  const FlipRates rates{0.975, 0.025};
  EXPECT_GE(McNemarPower(8, rates, 0.01), 0.8);
  EXPECT_LT(McNemarPower(10, rates, 0.01), 0.8);
  EXPECT_EQ(PairsForMcNemar(rates, {.alpha = 0.01}).n, 12);
}

TEST(Planning, WhatNoSizeCanShowIsUndefinedAndNonsenseIsRefused) {
  EXPECT_EQ(TrialsPerPolicy(0.5, 0.5 + 1e-12).exact.reason(), "more than can be counted");

  EXPECT_FALSE(TrialsPerPolicy(0.4, 0.4).exact);
  EXPECT_FALSE(PairsForMcNemar({0.1, 0.1}).exact);
  EXPECT_FALSE(PairsForMcNemar({0.101, 0.1}, {}, 200).exact) << "more than 200";
  EXPECT_FALSE(PointsForCorrelation(0).exact);
  EXPECT_FALSE(PointsForCorrelation(1).exact);
  EXPECT_FALSE(DetectableDifference(0.5, 2));
  EXPECT_EQ(McNemarPower(0, {0.5, 0.1}), 0);
  EXPECT_EQ(McNemarPower(40, {0, 0}), 0);
  EXPECT_NEAR(McNemarPower(40, {1, 0}), 1, 1e-12);
  EXPECT_NEAR(FisherPower(10, 0, 1), 1, 1e-12);
  EXPECT_THROW(TrialsPerPolicy(0.4, 1.4), Error);
  EXPECT_THROW(TrialsPerPolicy(0.4, 0.5, {.alpha = 0}), Error);
  EXPECT_THROW(McNemarPower(40, {0.7, 0.7}), Error);
  EXPECT_THROW(TrialsForHalfWidth(0.4, 0), Error);
  EXPECT_THROW(PanelOf(0, 0.9), Error);
}

TEST(Planning, NonInferiorityNeedsTheSizesOfTheDesign) {
  EXPECT_NEAR(static_cast<double>(TrialsForNonInferiority(0.7, 0.1).n), 260, 3);
  EXPECT_NEAR(static_cast<double>(PairsForNonInferiority(0.2, 0.1).n), 124, 1);
}

/// Where nothing fails 0 episodes were named, and below 25 pairs the interval reaches the margin even without a flip.
TEST(Planning, NoFewerAreNamedThanShowItWhereNothingFlips) {
  for (const double rate : {0.0, 1.0}) EXPECT_EQ(TrialsForNonInferiority(rate, 0.1).n, 25) << "it was 0";
  EXPECT_EQ(PairsForNonInferiority(0.01, 0.1).n, 25) << "it was 7";
  EXPECT_GT(TangoDifference({{0, 0}, 25}, 0.9).interval->low, -0.1);
  EXPECT_LE(TangoDifference({{0, 0}, 24}, 0.9).interval->low, -0.1);
  EXPECT_EQ(PairsForNonInferiority(0, 0.1, {.alpha = 0.01}).n, 49);
  EXPECT_GT(TangoDifference({{0, 0}, 49}, 0.98).interval->low, -0.1);
  EXPECT_LE(TangoDifference({{0, 0}, 48}, 0.98).interval->low, -0.1);
}

/// How often the look at `n` pairs decides, of many such runs.
template <typename Decides>
double ShareThatDecides(std::int64_t n, const FlipRates& rates, Decides decides) {
  constexpr int kRuns = 2000;
  SplitMix64 random(5);
  int decided = 0;
  for (int run = 0; run < kRuns; ++run) {
    PairedOutcomes seen{{}, n};
    for (std::int64_t pair = 0; pair < n; ++pair) {
      const double u = random.Uniform();
      seen.flips.only_first += u < rates.only_first;
      seen.flips.only_second += u >= rates.only_first && u < rates.only_first + rates.only_second;
    }
    decided += decides(seen);
  }
  return static_cast<double>(decided) / kRuns;
}

TEST(SequentialPlanning, ThePlannedPairsHaveThePowerThatIsPromised) {
  for (const FlipRates& rates : {FlipRates{0.1, 0.1}, FlipRates{0.05, 0.02}, FlipRates{0.1, 0.15}}) {
    const SampleSize size = PairsForSequentialNonInferiority(rates, 0.1);
    ASSERT_TRUE(size.exact);
    const double power = ShareThatDecides(size.n, rates, [](const PairedOutcomes& seen) {
      return SequentialPairedDifference(seen).interval->low > -0.1;
    });
    EXPECT_NEAR(power, 0.8, 0.04) << rates.only_first << " " << rates.only_second << ", " << size.n << " pairs";
  }
  for (const FlipRates& rates : {FlipRates{0.05, 0.2}, FlipRates{0.3, 0.1}}) {
    const SampleSize size = PairsForFlipsBet(rates);
    ASSERT_TRUE(size.exact);
    const double power = ShareThatDecides(size.n, rates, [](const PairedOutcomes& seen) {
      return FlipsEValue(seen.flips.only_first, seen.flips.only_second) >= 20;
    });
    EXPECT_NEAR(power, 0.8, 0.04) << rates.only_first << " " << rates.only_second << ", " << size.n << " pairs";
  }
}

TEST(SequentialPlanning, TakesMoreThanATestThatLooksOnce) {
  EXPECT_GT(PairsForSequentialNonInferiority({0.1, 0.1}, 0.1).n, 2 * PairsForNonInferiority(0.2, 0.1).n);
  EXPECT_GT(PairsForFlipsBet({0.05, 0.2}).n, PairsForMcNemar({0.05, 0.2}).n);
}

TEST(SequentialPlanning, WhatCannotBeShownIsUndefined) {
  EXPECT_FALSE(PairsForFlipsBet({0.1, 0.1}).exact);
  EXPECT_FALSE(PairsForFlipsBet({0.1, 0.101}, {}, 1000).exact) << "more than 1000";
  EXPECT_FALSE(PairsForSequentialNonInferiority({0, 0.1}, 0.1).exact);
  EXPECT_THROW(PairsForFlipsBet({0.7, 0.7}), Error);
  EXPECT_THROW(PairsForFlipsBet({0.1, 0.2}, {.alpha = 0}), Error);
  EXPECT_THROW(PairsForSequentialNonInferiority({0.1, 0.1}, 0), Error);
  EXPECT_EQ(SequentialPairedDifference({{0, 0}, 0}).interval->low, -1);
}

TEST(FurtherWanted, CountsRepeatsByWhatTheyTell) {
  EXPECT_EQ(*FurtherWanted(30, {20, 20}), 10);
  EXPECT_EQ(*FurtherWanted(30, {200, 20}), 100) << "ten repeats tell as much as one state";
  EXPECT_EQ(*FurtherWanted(10, {20, 20}), 1);
  EXPECT_EQ(*FurtherWanted(7, {0, 0}), 7);
}

/// 10^32 was cast to a 64-bit integer.
TEST(FurtherWanted, MoreThanCanBeCountedAreNoNumber) {
  EXPECT_EQ(*FurtherWanted(0x1.0p52, {20, 20}), (std::int64_t{1} << 52) - 20);
  for (const double wanted : {0x1.0p53, 1e32, std::numeric_limits<double>::infinity(), std::nan("")}) {
    ASSERT_FALSE(FurtherWanted(wanted, {20, 20})) << wanted;
    EXPECT_EQ(FurtherWanted(wanted, {20, 20}).reason(), "more than can be counted");
  }
  EXPECT_FALSE(FurtherWanted(0x1.0p52, {200, 20})) << "of those that are there, ten tell as much as one";
}

}  // namespace
}  // namespace evac
