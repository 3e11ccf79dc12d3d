#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/bayes.h"
#include "core/statistics/many_comparisons.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/sequential.h"
#include "core/statistics/stratified.h"
#include "core/statistics/two_by_two.h"

namespace evac {
namespace {

using testing::ElementsAre;

TEST(RateDifference, SwappingTheTwoMirrorsTheInterval) {
  for (const auto& [b, c, n] : {std::tuple{0, 0, 5}, {3, 0, 3}, {9, 2, 40}, {1, 1, 2}, {0, 7, 100}}) {
    for (const auto interval_of : {TangoDifference, BonettPriceDifference}) {
      const Interval one = *interval_of({{b, c}, n}, 0.95).interval, other = *interval_of({{c, b}, n}, 0.95).interval;
      EXPECT_NEAR(one.low, -other.high, 1e-12) << b << " " << c << " " << n;
      EXPECT_LE(-1, one.low);
      EXPECT_LE(one.low, one.high);
      EXPECT_LE(one.high, 1);
    }
  }
}

TEST(RateDifference, AllFlipsOneWayReachTheEnd) {
  const Estimate all = TangoDifference({{7, 0}, 7});
  EXPECT_EQ(*all.value, 1);
  EXPECT_EQ(all.interval->high, 1);
  EXPECT_GT(all.interval->low, 0.2);
}

TEST(RateDifference, WithoutDataNothingIsKnown) {
  for (const Estimate& nothing : {TangoDifference({{0, 0}, 0}), NewcombeDifference({0, 0}, {3, 4})}) {
    EXPECT_FALSE(nothing.value);
    EXPECT_EQ(nothing.interval->low, -1);
    EXPECT_EQ(nothing.interval->high, 1);
  }
  EXPECT_THROW(TangoDifference({{3, 2}, 4}), Error);
  EXPECT_THROW(TangoDifference({{-1, 2}, 4}), Error);
  EXPECT_THROW(NewcombeDifference({5, 4}, {1, 2}), Error);
  EXPECT_THROW(TangoDifference({{1, 2}, 4}, 1.0), Error);
}

TEST(RateDifference, AsManyPairsAsThereAreLeaveOutTheEndOfTheirInterval) {
  for (const auto& [b, c, n] : {std::tuple{0, 4, 10}, {9, 2, 40}, {0, 0, 25}, {0, 1, 1}}) {
    const PairedOutcomes seen{{b, c}, n};
    const double end = TangoDifference(seen).interval->high;
    EXPECT_NEAR(*PairsUntilTangoLeavesOut(end, seen), n, 1e-6) << b << " " << c << " " << n;
    EXPECT_LT(*PairsUntilTangoLeavesOut((1 + end) / 2, seen), n) << "further away fewer do";
  }
  EXPECT_NEAR(*PairsUntilTangoLeavesOut(-0.1, {{0, 5}, 5}), 4.695, 1e-3);
  EXPECT_NEAR(*PairsUntilTangoLeavesOut(-0.1, {{0, 1}, 1}), 4.695, 1e-3) << "as many, whatever was seen of them";
  EXPECT_EQ(PairsUntilTangoLeavesOut(0.1, {}).reason(), "no pairs");
  EXPECT_FALSE(PairsUntilTangoLeavesOut(-0.25, {{0, 1}, 4})) << "it is the difference itself";
  EXPECT_THROW(PairsUntilTangoLeavesOut(1, {{0, 1}, 4}), Error);
}

TEST(EffectivePairs, CopiesOfOnePairCountOnceAndIndependentOnesAllOfThem) {
  using Clusters = std::vector<PairedOutcomes>;
  const PairedOutcomes single = EffectivePairs(Clusters{{{1, 0}, 1}, {{0, 1}, 1}, {{0, 0}, 1}});
  EXPECT_EQ(single.pairs, 3);
  EXPECT_EQ(single.flips.only_first, 1);
  const PairedOutcomes agreeing = EffectivePairs(Clusters{{{0, 0}, 5}, {{0, 0}, 5}});
  EXPECT_EQ(agreeing.pairs, 2) << "nothing shows that the five are not one";
  Clusters copies;
  for (int state = 0; state < 40; ++state) copies.push_back({{state < 10 ? 5 : 0, 0}, 5});
  const PairedOutcomes effective = EffectivePairs(copies);
  EXPECT_NEAR(static_cast<double>(effective.pairs), 40, 2);
  EXPECT_NEAR(static_cast<double>(effective.flips.only_first), 10, 1);
  EXPECT_EQ(EffectivePairs(Clusters{}).pairs, 0);
  EXPECT_THROW(EffectivePairs(Clusters{{{2, 2}, 3}}), Error);
}

TEST(EffectivePairs, OneStateIsOnePairHoweverOftenItIsRepeated) {
  using Clusters = std::vector<PairedOutcomes>;
  const PairedOutcomes flipped = EffectivePairs(Clusters{{{20, 0}, 20}, {{0, 0}, 0}});
  EXPECT_EQ(flipped.pairs, 1);
  EXPECT_EQ(flipped.flips.only_first, 1);
  const PairedOutcomes alike = EffectivePairs(Clusters{{{2, 1}, 20}});
  EXPECT_EQ(alike.pairs, 1);
  EXPECT_EQ(alike.flips.only_first + alike.flips.only_second, 0);
  EXPECT_EQ(EffectivePairs(Clusters{{{1, 0}, 1}}).flips.only_first, 1) << "nothing is repeated";
}

/// `worse` pairs in which only the second succeeds, one a state until all have one, then two.
std::vector<PairedOutcomes> SpreadOver(std::size_t states, std::int64_t repeats, std::size_t worse) {
  std::vector<PairedOutcomes> clusters(states, PairedOutcomes{{0, 0}, repeats});
  for (std::size_t flip = 0; flip < worse; ++flip) ++clusters[flip % states].flips.only_second;
  return clusters;
}

/// Of 90 pairs in 30 states that all agree each state counted once, with one flip each pair: "unknown" became "yes".
TEST(RateDifference, OneFlipMoreIsNoBetterEvidence) {
  for (const double confidence : {0.8, 0.9, 0.95, 0.99}) {
    for (const std::size_t states : {2, 3, 5, 10, 30}) {
      for (const std::int64_t repeats : {1, 2, 3, 4, 8}) {
        double lowest = 1;
        for (std::size_t worse = 0; worse <= states * static_cast<std::size_t>(repeats); ++worse) {
          const Estimate difference = TangoOfClusters(SpreadOver(states, repeats, worse), confidence);
          EXPECT_LE(difference.interval->low, lowest + 1e-9) << states << " " << repeats << " " << worse;
          EXPECT_LE(difference.interval->low, *difference.value + 1e-9);
          EXPECT_GE(difference.interval->high, *difference.value - 1e-9);
          lowest = difference.interval->low;
        }
      }
    }
  }
}

TEST(RateDifference, ItsIntervalRestsOnAsManyPairsAsTheFlipsVouchFor) {
  EXPECT_EQ(PairsOfInterval(SpreadOver(30, 3, 0)).effective, 30) << "nothing shows that the three are not one";
  EXPECT_EQ(PairsOfInterval(SpreadOver(30, 3, 1)).effective, 36);
  EXPECT_EQ(PairsOfInterval(SpreadOver(30, 3, 6)).effective, 90) << "six flips in six states show it";
  EXPECT_EQ(PairsOfInterval(SpreadOver(30, 3, 6)).all, 90);
  EXPECT_EQ(EffectivePairs(SpreadOver(30, 3, 6)).flips.only_second, 6) << "to the test all six are flips";
  const std::vector<PairedOutcomes> single = SpreadOver(30, 1, 1);
  EXPECT_EQ(TangoOfClusters(single).interval->low, TangoDifference({{0, 1}, 30}).interval->low);
  EXPECT_EQ(TangoOfClusters({}).interval->low, -1);
  EXPECT_FALSE(TangoOfClusters({}).value);
}

TEST(RateDifference, NewcombeOfRatesIsNewcombeWhereNoStateRepeats) {
  const Estimate counts = NewcombeDifference({7, 10}, {3, 12});
  const Estimate rates = NewcombeOfRates(WilsonInterval(7, 10), WilsonInterval(3, 12));
  EXPECT_EQ(counts.interval->low, rates.interval->low);
  EXPECT_EQ(counts.interval->high, rates.interval->high);
  EXPECT_EQ(rates.n, 22);
  const std::vector<Count> copies(4, Count{5, 5}), others = {{5, 5}, {0, 5}, {0, 5}, {0, 5}};
  const Estimate clustered = NewcombeOfRates(ClusteredWilsonInterval(copies), ClusteredWilsonInterval(others));
  EXPECT_NEAR(clustered.interval->low, NewcombeDifference({4, 4}, {1, 4}).interval->low, 1e-9);
}

TEST(RateDifference, TangoLeavesOutZeroWhenItsScoreTestRejects) {
  for (int b = 0; b <= 20; ++b) {
    const Interval interval = *TangoDifference({{b, 3}, 40}).interval;
    const double z = std::abs(b - 3) / std::sqrt(std::max(1, b + 3));  // McNemar's
    EXPECT_EQ(z > 1.959963984540054, interval.low > 0 || interval.high < 0) << b;
  }
}

TEST(TwoByTwo, EqualTablesFromBothSidesGiveOneP) {
  for (const auto& [x1, n1, x2, n2] : {std::tuple{7, 15, 12, 15}, {0, 1, 1, 1}, {3, 9, 20, 31}, {0, 2, 9, 23}}) {
    const Count first{x1, n1}, second{x2, n2};
    for (const auto test : {FisherExact, BarnardExact, BoschlooExact}) {
      const ExactTest there = test(first, second), back = test(second, first);
      EXPECT_NEAR(there.two_sided, back.two_sided, 1e-12);
      EXPECT_NEAR(there.greater, back.less, 1e-12);
      const ExactTest failures = test({n1 - x1, n1}, {n2 - x2, n2});
      EXPECT_NEAR(there.two_sided, failures.two_sided, 1e-12);
    }
    EXPECT_NEAR(PooledZ(first, second), -PooledZ(second, first), 1e-12);
  }
}

TEST(TwoByTwo, BoschlooIsNeverAboveFisherOneSided) {
  for (int x1 = 0; x1 <= 9; ++x1) {
    for (int x2 = 0; x2 <= 6; ++x2) {
      const ExactTest fisher = FisherExact({x1, 9}, {x2, 6}), boschloo = BoschlooExact({x1, 9}, {x2, 6});
      EXPECT_LE(boschloo.greater, fisher.greater + 1e-12);
      EXPECT_LE(boschloo.less, fisher.less + 1e-12);
    }
  }
}

double Chance(int k, int n, double p) {
  return std::exp(std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1)) * std::pow(p, k) *
         std::pow(1 - p, n - k);
}

TEST(TwoByTwo, ItsFalseAlarmsStayBelowAlphaForEveryCommonRate) {
  const std::vector<double> rates{0.05, 0.3, 0.5, 0.8};
  std::vector<double> alarms(rates.size(), 0);
  for (int x1 = 0; x1 <= 6; ++x1) {
    for (int x2 = 0; x2 <= 9; ++x2) {
      if (BarnardExact({x1, 6}, {x2, 9}).two_sided > 0.05) continue;
      for (std::size_t i = 0; i < rates.size(); ++i) alarms[i] += Chance(x1, 6, rates[i]) * Chance(x2, 9, rates[i]);
    }
  }
  for (std::size_t i = 0; i < rates.size(); ++i) EXPECT_LE(alarms[i], 0.05 + 1e-9) << rates[i];
}

TEST(TwoByTwo, NoTrialsProveNothingAndTooManyAreRefused) {
  EXPECT_EQ(BoschlooExact({0, 0}, {3, 3}).two_sided, 1);
  EXPECT_EQ(PooledZ({0, 0}, {3, 3}), 0);
  EXPECT_THROW(FisherExact({1, 3000}, {1, 3000}), Error);
  EXPECT_LT(FisherExact({1200, 2000}, {900, 2000}).two_sided, 1e-12);
}

TEST(Stratified, OneStratumIsTheTwoRates) {
  const Stratum stratum{{28, 40}, {20, 40}};
  const StratifiedTest test = MantelHaenszel(std::vector{stratum});
  EXPECT_NEAR(*test.risk_difference.value, 0.2, 1e-12);
  EXPECT_NEAR(*test.odds_ratio, 28.0 * 20 / (12 * 20), 1e-12);
  EXPECT_TRUE(test.risk_difference.interval);
}

TEST(Stratified, TrialsNeedNotBeWhole) {
  const std::vector<Stratum> whole{{{4, 8}, {2, 8}}, {{6, 8}, {5, 8}}}, part{{{2, 4}, {1, 4}}, {{3, 4}, {2.5, 4}}};
  const StratifiedTest all = MantelHaenszel(whole), half = MantelHaenszel(part);
  EXPECT_NEAR(*half.risk_difference.value, *all.risk_difference.value, 1e-12);
  EXPECT_NEAR(*half.difference_se, *all.difference_se * std::sqrt(2), 1e-12) << "half of the trials tell half as much";
  EXPECT_THROW(MantelHaenszel(std::vector<Stratum>{{{2.5, 2}, {1, 4}}}), Error);
}

TEST(Stratified, WhatCannotTellIsUndefined) {
  EXPECT_FALSE(MantelHaenszel({}).chi2);
  EXPECT_FALSE(MantelHaenszel(std::vector<Stratum>{{{3, 3}, {4, 4}}}).p);
  EXPECT_FALSE(MantelHaenszel(std::vector<Stratum>{{{0, 0}, {4, 4}}}).risk_difference.value);
  EXPECT_FALSE(CochranQTest({}).q);
  EXPECT_THROW(CochranQTest({{true, false}, {true}}), Error);
}

TEST(Stratified, CochransQOfTwoPoliciesIsMcNemars) {
  std::vector<std::vector<bool>> outcomes;
  for (int i = 0; i < 9; ++i) outcomes.push_back({true, false});
  for (int i = 0; i < 2; ++i) outcomes.push_back({false, true});
  for (int i = 0; i < 5; ++i) outcomes.push_back({true, true});
  EXPECT_NEAR(*CochranQTest(outcomes).q, *McNemarExact({9, 2}).chi2, 1e-12);
}

TEST(ManyComparisons, AdjustedValuesKeepTheOrderAndHolmIsAboveBenjaminiHochberg) {
  const std::vector<double> p{0.04, 0.01, 0.01, 0.7, 0, 1};
  const auto holm = HolmAdjusted(p), bh = BenjaminiHochbergAdjusted(p), bonferroni = BonferroniAdjusted(p);
  for (std::size_t i = 0; i < p.size(); ++i) {
    EXPECT_LE(p[i], bh[i]);
    EXPECT_LE(bh[i], holm[i]);
    EXPECT_LE(holm[i], bonferroni[i]);
    for (std::size_t j = 0; j < p.size(); ++j) EXPECT_TRUE(p[i] < p[j] || holm[i] >= holm[j]);
  }
  EXPECT_THROW(HolmAdjusted(std::vector{1.2}), Error);
  EXPECT_THROW(BonferroniAdjusted(std::vector{std::nan("")}), Error);
}

TEST(CompactLetters, TwoShareALetterExactlyIfTheyDoNotDiffer) {
  SplitMix64 random(3);
  for (int round = 0; round < 300; ++round) {
    const std::size_t policies = 2 + random.Below(8);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < policies; ++i) {
      for (std::size_t j = i + 1; j < policies; ++j) {
        if (random.Below(2) == 1) pairs.emplace_back(i, j);
      }
    }
    const std::vector<std::string> letters = CompactLetters(policies, pairs);
    for (std::size_t i = 0; i < policies; ++i) {
      EXPECT_FALSE(letters[i].empty());
      for (std::size_t j = i + 1; j < policies; ++j) {
        const bool differ = std::ranges::find(pairs, std::pair(i, j)) != pairs.end();
        const bool share = letters[i].find_first_of(letters[j]) != std::string::npos;
        EXPECT_NE(differ, share) << i << " " << j;
      }
    }
  }
}

TEST(CompactLetters, TheOrderOfPairsDoesNotMatter) {
  using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
  EXPECT_EQ(CompactLetters(3, Pairs{{2, 0}}), CompactLetters(3, Pairs{{0, 2}}));
  EXPECT_THAT(CompactLetters(1, Pairs{}), ElementsAre("a"));
  EXPECT_THAT(CompactLetters(0, Pairs{}), ElementsAre());
  EXPECT_THROW(CompactLetters(2, Pairs{{0, 2}}), Error);
  EXPECT_THROW(CompactLetters(2, Pairs{{1, 1}}), Error);
}

TEST(ProbabilityGreater, TheTwoChancesAddUpToOneAndTheMethodsAgree) {
  for (const BetaPrior& prior : {BetaPrior{1, 1}, {0.5, 0.5}, {0.2, 0.7}, {2, 3.5}}) {
    const double there = ProbabilityGreater({17, 30}, {9, 25}, prior),
                 back = ProbabilityGreater({9, 25}, {17, 30}, prior);
    EXPECT_NEAR(there + back, 1, 1e-9);
  }
  // The finite sum at a whole parameter, the quadrature just beside it.
  EXPECT_NEAR(ProbabilityGreater({17, 30}, {9, 25}, {1, 1}), ProbabilityGreater({17, 30}, {9, 25}, {1 + 1e-9, 1}),
              1e-8);
  EXPECT_NEAR(ProbabilityGreater({900, 2000}, {900, 2000}, {0.5, 0.5}), 0.5, 1e-9);
  EXPECT_THROW(ProbabilityGreater({1, 2}, {1, 2}, {0, 1}), Error);
}

TEST(Sequential, MirroredDataGiveTheMirroredTest) {
  const std::vector<bool> a{true, true, false, true, true, true}, b{false, true, false, false, false, false};
  const SequentialTest above = TwoRatesSequential(a, b, RateOrder::kFirstAbove);
  const SequentialTest below = TwoRatesSequential(b, a, RateOrder::kFirstBelow);
  EXPECT_EQ(above.e_values, below.e_values);
  const SequentialTest either = TwoRatesSequential(a, b, RateOrder::kEither);
  const SequentialTest wrong = TwoRatesSequential(a, b, RateOrder::kFirstBelow);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(either.e_values[i], (above.e_values[i] + wrong.e_values[i]) / 2, 1e-12);
  }
  EXPECT_THROW(TwoRatesSequential(a, {true}, RateOrder::kEither), Error);
  EXPECT_THROW(TwoRatesSequential(a, b, RateOrder::kEither, 0), Error);
}

TEST(Sequential, TheFlipsBetIsAFairGame) {
  // The expected e-value after m fair flips is exactly 1.
  for (const int m : {1, 5, 12}) {
    double mean = 0;
    for (int b = 0; b <= m; ++b) {
      mean += FlipsEValue(b, m - b) * std::exp(std::lgamma(m + 1) - std::lgamma(b + 1) - std::lgamma(m - b + 1)) *
              std::pow(0.5, m);
    }
    EXPECT_NEAR(mean, 1, 1e-12);
  }
  FlipsBet bet;
  for (int i = 0; i < 7; ++i) bet.Add(true, false);
  bet.Add(true, true);
  EXPECT_EQ(bet.e_value(), FlipsEValue(7, 0));
  EXPECT_GT(bet.e_value(), 20);
  EXPECT_TRUE(std::isfinite(FlipsEValue(2000, 0))) << "2^2000 is no number of a JSON file";
  EXPECT_THROW(FlipsEValue(-1, 0), Error);
}

TEST(Sequential, TheConfidenceSequenceIsWiderThanTheFixedIntervalAndHoldsTheRate) {
  for (const auto& [k, n] : {std::pair{0, 5}, {5, 5}, {3, 17}, {600, 1000}}) {
    const Interval sequence = *ConfidenceSequence({k, n}).interval, fixed = *ClopperPearsonInterval(k, n).interval;
    EXPECT_LE(sequence.low, fixed.low + 1e-12);
    EXPECT_GE(sequence.high, fixed.high - 1e-12);
  }
}

}  // namespace
}  // namespace evac
