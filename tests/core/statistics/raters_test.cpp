#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/bradley_terry.h"
#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/dawid_skene.h"
#include "core/statistics/rater_agreement.h"
#include "core/statistics/rates.h"
#include "core/statistics/votes.h"

namespace evac {
namespace {

using testing::HasSubstr;
using Counts = std::vector<std::vector<std::int64_t>>;
using Ratings = std::vector<std::vector<std::optional<double>>>;

TEST(FleissKappa, OnCompleteDataItIsRelatedToKrippendorffsAlpha) {
  SplitMix64 random(5);
  Counts counts;
  Ratings ratings(3);
  for (int item = 0; item < 30; ++item) {
    counts.push_back({0, 0, 0});
    for (auto& rater : ratings) {
      const auto said = random.Below(3);
      rater.push_back(static_cast<double>(said));
      ++counts.back()[said];
    }
  }
  const double kappa = *FleissKappaOf(counts).kappa, pairs = 30 * 3;
  EXPECT_NEAR(*KrippendorffAlpha(ratings, RatingMetric::kNominal), 1 - (1 - kappa) * (pairs - 1) / pairs, 1e-12);
}

TEST(FleissKappa, WhatItCannotSayIsUndefinedOrRefused) {
  EXPECT_FALSE(FleissKappaOf({}).kappa);
  EXPECT_FALSE(FleissKappaOf({{1, 0}, {0, 1}}).kappa);
  EXPECT_FALSE(FleissKappaOf({{3, 0}, {3, 0}}).kappa);
  EXPECT_EQ(*FleissKappaOf({{3, 0}, {3, 0}}).agreement, 1);
  EXPECT_THROW(FleissKappaOf({{3, 0}, {2, 0}}), Error);
  EXPECT_THROW(FleissKappaOf({{3, 0}, {3}}), Error);
  EXPECT_THROW(FleissKappaOf({{4, -1}, {3, 0}}), Error);
  const FleissKappa skewed = FleissKappaOf({{3, 0, 0}, {2, 1, 0}});
  EXPECT_FALSE(skewed.kappa_of_category[2]) << "nobody chose it";
}

TEST(KrippendorffAlpha, OrderOfRatersAndScaleDoNotMatter) {
  const Ratings ratings{{1, 2, 3, 3, {}}, {1, 2, 2, {}, 5}, {{}, 2, 3, 4, 5}};
  const Ratings swapped{ratings[2], ratings[0], ratings[1]};
  Ratings doubled = ratings;
  for (auto& rater : doubled) {
    for (auto& rating : rater) rating = rating ? std::optional(*rating * 2) : rating;
  }
  for (const auto metric :
       {RatingMetric::kNominal, RatingMetric::kOrdinal, RatingMetric::kInterval, RatingMetric::kRatio}) {
    EXPECT_NEAR(*KrippendorffAlpha(ratings, metric), *KrippendorffAlpha(swapped, metric), 1e-12);
    EXPECT_NEAR(*KrippendorffAlpha(ratings, metric), *KrippendorffAlpha(doubled, metric), 1e-12);
  }
}

TEST(KrippendorffAlpha, WithoutPairsOrVariationItIsUndefined) {
  EXPECT_FALSE(KrippendorffAlpha({}, RatingMetric::kNominal));
  EXPECT_FALSE(KrippendorffAlpha({{1, {}}, {{}, 2}}, RatingMetric::kNominal));
  EXPECT_FALSE(KrippendorffAlpha({{1, 1}, {1, 1}}, RatingMetric::kOrdinal));
  EXPECT_THROW(KrippendorffAlpha({{1, 1}, {1}}, RatingMetric::kOrdinal), Error);
  EXPECT_THROW(KrippendorffAlpha({{-1}, {1}}, RatingMetric::kRatio), Error);
}

TEST(ConfusionTable, AnEmptyOrConstantOneLeavesUndefinedWhatItMust) {
  const ConfusionStatistics empty = StatisticsOf({});
  EXPECT_FALSE(empty.accuracy);
  EXPECT_FALSE(empty.kappa.value);
  const ConfusionStatistics all_failures = StatisticsOf({.both_failure = 12});
  EXPECT_FALSE(all_failures.kappa.value);
  EXPECT_FALSE(all_failures.sensitivity.value);
  EXPECT_FALSE(all_failures.f1);
  EXPECT_EQ(*all_failures.gwet_ac1, 1);
  EXPECT_THROW(StatisticsOf({.both_success = -1}), Error);
}

TEST(ConfusionTable, NoKappaIsSaidToBeAboveOne) {
  const ConfusionStatistics nearly_equal = StatisticsOf({39, 3, 0, 37});
  EXPECT_GT(*nearly_equal.kappa.value + 1.96 * *nearly_equal.kappa_se, 1) << "the sample does not show it";
  EXPECT_EQ(nearly_equal.kappa.interval->high, 1);
  EXPECT_LT(nearly_equal.kappa.interval->low, 0.9);
  const ConfusionStatistics opposite = StatisticsOf({0, 37, 39, 2});
  EXPECT_EQ(opposite.kappa.interval->low, -1);
}

TEST(ConfusionTable, SwappingJudgeAndHumanKeepsTheAgreementAndTurnsTheBias) {
  const ConfusionStatistics one = StatisticsOf({25, 4, 3, 8}), other = StatisticsOf({25, 3, 4, 8});
  EXPECT_NEAR(*one.kappa.value, *other.kappa.value, 1e-12);
  EXPECT_NEAR(*one.kappa_se, *other.kappa_se, 1e-12);
  EXPECT_NEAR(*one.bias, -*other.bias, 1e-12);
  EXPECT_NEAR(*one.matthews, *other.matthews, 1e-12);
}

/// One item per state, in cells of a table; then each item so many times in its state.
ConfusionByState States(const Confusion& table, std::int64_t repeats) {
  ConfusionByState states;
  const auto add = [&](std::int64_t count, bool judge, bool human) {
    for (std::int64_t i = 0; i < count; ++i) {
      Confusion& state = states[{"lift", std::to_string(states.size())}];
      for (std::int64_t repeat = 0; repeat < repeats; ++repeat) state.Add(judge, human);
    }
  };
  add(table.both_success, true, true);
  add(table.only_judge_success, true, false);
  add(table.only_human_success, false, true);
  add(table.both_failure, false, false);
  return states;
}

TEST(ConfusionByState, OneItemAStateIsAsTheTableAlone) {
  const Confusion table{25, 4, 3, 8};
  const ConfusionStatistics alone = StatisticsOf(table), by_state = StatisticsByState(States(table, 1));
  EXPECT_EQ(*by_state.kappa.value, *alone.kappa.value);
  EXPECT_EQ(by_state.kappa.interval->low, alone.kappa.interval->low);
  EXPECT_EQ(by_state.kappa.method, alone.kappa.method);
}

TEST(ConfusionByState, TheSameClipFiveTimesTellsNoMoreThanOnce) {
  const Confusion table{25, 4, 3, 8};
  const ConfusionStatistics once = StatisticsOf(table), often = StatisticsByState(States(table, 5));
  EXPECT_EQ(often.n, 200);
  EXPECT_NEAR(*often.kappa.value, *once.kappa.value, 1e-12);
  EXPECT_NEAR(*often.kappa_se, std::sqrt(40.0 / 39) * *once.kappa_se, 1e-12) << "Fleiss, Cohen & Everitt, G / (G - 1)";
  const double t_of_39 = 2.0226909;  // from a table
  EXPECT_NEAR(often.kappa.interval->low, *often.kappa.value - t_of_39 * *often.kappa_se, 1e-6);
}

TEST(ConfusionByState, StatesThatDifferLessThanChanceClaimNoMoreThanIndependentItems) {
  ConfusionByState states;
  for (int i = 0; i < 12; ++i) states[{"lift", std::to_string(i)}] = {6, 1, 1, 4};
  EXPECT_NEAR(*StatisticsByState(states).kappa_se, *StatisticsOf(SumOf(states)).kappa_se, 1e-12);
}

TEST(ConfusionByState, ItemsOfOneStateDoNotSayHowKappaSpreads) {
  const ConfusionStatistics one = StatisticsByState({{{"lift", "0"}, {25, 4, 3, 8}}, {{"lift", "1"}, {}}});
  EXPECT_EQ(*one.kappa.value, *StatisticsOf({25, 4, 3, 8}).kappa.value);
  ASSERT_FALSE(one.kappa.interval);
  EXPECT_EQ(one.kappa.interval.reason(), "all items are of one initial state");
  EXPECT_FALSE(one.kappa_se);
  EXPECT_FALSE(StatisticsByState({}).kappa.value);
  EXPECT_THROW(StatisticsByState({{{"lift", "0"}, {4, 0, 0, -1}}, {{"lift", "1"}, {0, 0, 0, 9}}}), Error);
}

TEST(ConfusionByState, SensitivityAndSpecificityKnowNoMoreThanTheirStates) {
  const Confusion table{25, 4, 3, 8};
  const ConfusionStatistics once = StatisticsOf(table), often = StatisticsByState(States(table, 5));
  const ConfusionStatistics spread = StatisticsOf({125, 20, 15, 40});
  for (const auto share : {&ConfusionStatistics::sensitivity, &ConfusionStatistics::specificity}) {
    EXPECT_NEAR(*(often.*share).value, *(once.*share).value, 1e-12);
    EXPECT_NEAR((often.*share).interval->low, (once.*share).interval->low, 1e-12);
    EXPECT_LT((often.*share).interval->low, (spread.*share).interval->low - 0.03) << "as if they were independent";
  }
  const Estimate wilson = WilsonInterval(25, 28);
  EXPECT_EQ(once.sensitivity.interval->low, wilson.interval->low);
  EXPECT_EQ(once.sensitivity.n, 28);
  EXPECT_EQ(once.specificity.n, 12);
  const ConfusionStatistics no_success = StatisticsByState({{{"lift", "0"}, {0, 1, 0, 2}}});
  EXPECT_EQ(no_success.sensitivity.value.reason(), "the human saw no success");
  EXPECT_FALSE(no_success.sensitivity.interval);
}

TEST(RoganGladen, APerfectJudgeIsBelievedAndAUselessOneIsNot) {
  EXPECT_NEAR(*RoganGladen({0.3, 100}, {1, 1, 20, 20}).rate, 0.3, 1e-12);
  EXPECT_FALSE(RoganGladen({0.3, 100}, {0.7, 0.3, 20, 20}).rate);
  EXPECT_FALSE(RoganGladen({0.3, 100}, {0.9, 0.9, 0, 20}).se);
  EXPECT_THROW(RoganGladen({1.3, 100}, {}), Error);
}

TEST(Calibration, PerfectProbabilitiesCostNothingAndBadInputIsRefused) {
  const std::vector<double> p{1, 0, 1};
  const std::vector<int> outcomes{1, 0, 1};
  EXPECT_NEAR(*CalibrationOf(p, outcomes).brier.value, 0, 1e-12);
  EXPECT_NEAR(*CalibrationOf(p, outcomes).ece, 0, 1e-12);
  EXPECT_FALSE(CalibrationOf({}, {}).brier.value);
  EXPECT_THROW(CalibrationOf(p, std::vector{1, 0}), Error);
  EXPECT_THROW(CalibrationOf(p, std::vector{1, 0, 2}), Error);
  EXPECT_THROW(CalibrationOf(p, outcomes, {.bins = 0}), Error);
}

/// 40 items of losses .01, .04 or .81, one per state; each so many times in its state.
StatedByState StatedIn(int repeats) {
  StatedByState states;
  for (int i = 0; i < 40; ++i) {
    const StatedProbability stated = {i % 7 == 0 ? 0.9 : i % 2 ? 0.1 : 0.2, false};
    states[{"lift", std::to_string(i)}].assign(static_cast<std::size_t>(repeats), stated);
  }
  return states;
}

TEST(Calibration, TheSameClipFiveTimesTellsNoMoreOfBrierThanOnce) {
  const Calibration once = CalibrationByState(StatedIn(1)), often = CalibrationByState(StatedIn(5));
  const double brier = (6 * 0.81 + 17 * 0.01 + 17 * 0.04) / 40;
  EXPECT_NEAR(*once.brier.value, brier, 1e-12);
  double squares = 0;
  for (const auto& [state, stated] : StatedIn(1))
    squares += std::pow(stated.front().probability * stated.front().probability - brier, 2);
  const double t_of_39 = 2.0226909;  // from a table
  EXPECT_NEAR(once.brier.interval->high, brier + t_of_39 * std::sqrt(squares / 39 / 40), 1e-6);
  EXPECT_NEAR(often.brier.interval->high, once.brier.interval->high, 1e-9);
  EXPECT_EQ(often.brier.n, 200);
  EXPECT_NEAR(*often.ece, *once.ece, 1e-12);
}

TEST(Calibration, StatesThatDifferLessThanChanceClaimNoMoreThanIndependentItems) {
  StatedByState alike, apart;
  for (int i = 0; i < 24; ++i) {
    alike[{"lift", std::to_string(i / 2)}].push_back({i % 2 ? 0.1 : 0.8, false});
    apart[{"lift", std::to_string(i)}].push_back({i % 2 ? 0.1 : 0.8, false});
  }
  const auto width = [](const StatedByState& states) {
    const Interval interval = *CalibrationByState(states).brier.interval;
    return interval.high - interval.low;
  };
  EXPECT_GE(width(alike), width(apart));
}

TEST(Calibration, ItemsOfOneStateDoNotSayHowBrierSpreads) {
  const Calibration one = CalibrationByState({{{"lift", "0"}, {{0.2, false}, {0.7, true}}}, {{"lift", "1"}, {}}});
  EXPECT_NEAR(*one.brier.value, (0.04 + 0.09) / 2, 1e-12);
  ASSERT_FALSE(one.brier.interval);
  EXPECT_EQ(one.brier.interval.reason(), "all items are of one initial state");
  EXPECT_FALSE(CalibrationByState({}).brier.value);
  const Calibration alike = CalibrationByState({{{"lift", "0"}, {{0.9, true}}}, {{"lift", "1"}, {{0.9, true}}}});
  EXPECT_EQ(alike.brier.interval.reason(), "the estimated spread is 0") << "no error seen is not none there";
  EXPECT_THROW(CalibrationByState({{{"lift", "0"}, {{1.2, false}}}}), Error);
}

TEST(Votes, UnsureAndMissingDecideNothing) {
  const std::vector<Vote> votes{Vote::kUnsure, Vote::kMissing, Vote::kFailure};
  const Majority majority = MajorityOf(votes);
  EXPECT_EQ(majority.success, false);
  EXPECT_EQ(majority.valid, 1);
  EXPECT_FALSE(MajorityOf({}).success);
  EXPECT_FALSE(BangBlindingIndex({}).index);
  EXPECT_THROW(BangBlindingIndex({-1, 0, 0}), Error);
}

TEST(DawidSkene, FindsTheBadRater) {
  SplitMix64 random(2);
  RaterCounts counts{.items = 200, .labels = 2, .of_rater = std::vector<std::vector<RaterCounts::Said>>(3)};
  const double accuracy[] = {0.95, 0.9, 0.55};
  for (int item = 0; item < 200; ++item) {
    const int truth = random.Uniform() < 0.6;
    for (std::size_t rater = 0; rater < 3; ++rater) {
      const int said = random.Uniform() < accuracy[rater] ? truth : 1 - truth;
      counts.of_rater[rater].push_back({item, said});
    }
  }
  const DawidSkene model = FitDawidSkene(counts);
  EXPECT_NEAR(model.prior(1), 0.6, 0.1);
  EXPECT_GT(model.confusion[0](1, 1), 0.85);
  EXPECT_LT(model.confusion[2](1, 1), 0.75);
  EXPECT_THROW(FitDawidSkene({}), Error);
  for (const RaterCounts::Said wrong :
       {RaterCounts::Said{200, 0}, RaterCounts::Said{0, 2}, RaterCounts::Said{-1, 0}, RaterCounts::Said{0, 0, -1}}) {
    counts.of_rater[0][0] = wrong;
    EXPECT_THROW(FitDawidSkene(counts), Error);
  }
}

TEST(DawidSkene, AnItemThatNobodyRatedHasThePriorAsItsAnswer) {
  const RaterCounts counts{.items = 3, .labels = 2, .of_rater = {{{0, 1}, {1, 1}}}};
  const DawidSkene model = FitDawidSkene(counts);
  EXPECT_NEAR(model.posterior(2, 1), model.prior(1), 1e-6);
}

TEST(BradleyTerry, SeparatedOrDisconnectedPoliciesNeedARidge) {
  Eigen::MatrixXd separated(3, 3);
  separated << 0, 4, 5, 0, 0, 3, 0, 2, 0;
  const auto refused = FitBradleyTerry(separated, 0);
  EXPECT_FALSE(refused);
  EXPECT_THAT(refused.reason(), HasSubstr("never lost"));
  const auto ridged = FitBradleyTerry(separated, 1);
  ASSERT_TRUE(ridged);
  EXPECT_GT(ridged->strength(0), ridged->strength(1));
  EXPECT_NEAR(ridged->strength.sum(), 0, 1e-12);
  EXPECT_FALSE(FitBradleyTerry(Eigen::MatrixXd::Zero(2, 2), 0));
  EXPECT_FALSE(FitBradleyTerry(Eigen::MatrixXd(), 1));
  EXPECT_THROW(FitBradleyTerry(Eigen::MatrixXd::Zero(2, 3), 1), Error);
  EXPECT_THROW(FitBradleyTerry(-Eigen::MatrixXd::Ones(2, 2), 1), Error);
}

TEST(BradleyTerry, OfTwoPoliciesItIsTheLogOdds) {
  Eigen::MatrixXd wins(2, 2);
  wins << 0, 12, 5, 0;
  const auto fit = FitBradleyTerry(wins, 0);
  EXPECT_NEAR(fit->strength(0) - fit->strength(1), std::log(12.0 / 5), 1e-10);
  EXPECT_NEAR(fit->SeOfDifference(0, 1), std::sqrt(1 / 12.0 + 1 / 5.0), 1e-10);
}

}  // namespace
}  // namespace evac
