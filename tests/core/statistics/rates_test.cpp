#include "core/statistics/rates.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

using IntervalFunction = Estimate (*)(std::int64_t, std::int64_t, double);

class EveryRateInterval : public testing::TestWithParam<IntervalFunction> {};

TEST_P(EveryRateInterval, HoldsTheRateAndIsTheMirrorImageForFailures) {
  for (const std::int64_t n : {1, 2, 7, 40, 1000}) {
    for (std::int64_t k = 0; k <= n; k += 1 + n / 20) {
      const Estimate rate = GetParam()(k, n, 0.95), mirrored = GetParam()(n - k, n, 0.95);
      EXPECT_LE(0, rate.interval->low);
      EXPECT_LE(rate.interval->low, *rate.value);
      EXPECT_LE(*rate.value, rate.interval->high);
      EXPECT_LE(rate.interval->high, 1);
      EXPECT_NEAR(rate.interval->low, 1 - mirrored.interval->high, 1e-12);
      EXPECT_EQ(rate.n, n);
    }
  }
}

TEST_P(EveryRateInterval, TouchesZeroAndOneExactlyAtTheEnds) {
  EXPECT_EQ(GetParam()(0, 20, 0.95).interval->low, 0);
  EXPECT_EQ(GetParam()(20, 20, 0.95).interval->high, 1);
}

TEST_P(EveryRateInterval, IsWiderForMoreConfidence) {
  const Interval narrow = *GetParam()(13, 20, 0.8).interval, wide = *GetParam()(13, 20, 0.99).interval;
  EXPECT_LT(wide.low, narrow.low);
  EXPECT_GT(wide.high, narrow.high);
}

TEST_P(EveryRateInterval, SaysNothingWithoutTrials) {
  const Estimate rate = GetParam()(0, 0, 0.95);
  EXPECT_FALSE(rate.value);
  EXPECT_EQ(rate.value.reason(), "no trials");
  EXPECT_EQ(rate.interval->low, 0);
  EXPECT_EQ(rate.interval->high, 1);
}

TEST_P(EveryRateInterval, RefusesWhatIsNoCountOrNoConfidence) {
  EXPECT_THROW(GetParam()(5, 3, 0.95), Error);
  EXPECT_THROW(GetParam()(-1, 3, 0.95), Error);
  EXPECT_THROW(GetParam()(0, -1, 0.95), Error);
  EXPECT_THROW(GetParam()(1, 3, 1.0), Error);
  EXPECT_THROW(GetParam()(1, 3, 0.0), Error);
}

INSTANTIATE_TEST_SUITE_P(WilsonClopperPearsonJeffreys, EveryRateInterval,
                         testing::Values(WilsonInterval, ClopperPearsonInterval, JeffreysInterval));

TEST(ClopperPearson, CoversTheTrueRateAtLeastAsOftenAsItPromises) {
  constexpr int n = 20;
  for (double p = 0.02; p < 1; p += 0.02) {
    double covered = 0;  // exactly, by summing the binomial
    for (int k = 0; k <= n; ++k) {
      const Interval interval = *ClopperPearsonInterval(k, n).interval;
      if (interval.low > p || p > interval.high) continue;
      covered += (k < n ? 1 - BetaCdf(k + 1, n - k, p) : 1) - (k > 0 ? 1 - BetaCdf(k, n - k + 1, p) : 0);
    }
    EXPECT_GE(covered, 0.95 - 1e-12) << p;
  }
}

TEST(ClusteredRate, IsPlainWilsonWhereEveryClusterHasOneTrial) {
  const std::vector<Count> clusters = {{1, 1}, {0, 1}, {1, 1}, {1, 1}};
  const Estimate clustered = ClusteredWilsonInterval(clusters), plain = WilsonInterval(3, 4);
  EXPECT_EQ(clustered.interval->low, plain.interval->low);
  EXPECT_EQ(clustered.method, "Wilson");
  EXPECT_EQ(StatisticsOfClusters(clusters).icc.reason(), "no cluster has more than one trial");
}

TEST(ClusteredRate, CountsClustersWhereTrialsWithinThemAreCopies) {
  const std::vector<Count> copies = {{5, 5}, {0, 5}, {5, 5}, {0, 5}, {5, 5}, {5, 5}};
  const ClusterStatistics statistics = StatisticsOfClusters(copies);
  EXPECT_NEAR(*statistics.icc, 1, 1e-12);
  EXPECT_NEAR(*statistics.effective_trials, 6, 1e-12);
  const Estimate clustered = ClusteredWilsonInterval(copies), of_clusters = WilsonInterval(4, 6);
  EXPECT_NEAR(clustered.interval->low, of_clusters.interval->low, 1e-12);
  EXPECT_NEAR(clustered.interval->high, of_clusters.interval->high, 1e-12);
  EXPECT_EQ(clustered.n, 30);
}

TEST(ClusteredRate, CountsWhatItsTrialsRestOnWhereClustersDifferInSize) {
  const std::vector<Count> copies = {{0, 1}, {1, 1}, {1, 1}, {1, 1}, {0, 1}, {10, 10}};  // a state tried ten times
  const ClusterStatistics statistics = StatisticsOfClusters(copies);
  EXPECT_NEAR(*statistics.icc, 1, 1e-12);
  EXPECT_NEAR(*statistics.design_effect, 105.0 / 15, 1e-12) << "sum of squares over sum";
  EXPECT_NEAR(*statistics.effective_trials, 225.0 / 105, 1e-12) << "fewer than the states, as most rest on one";
  EXPECT_LT(ClusteredWilsonInterval(copies).interval->low, 0.3);
}

TEST(ClusteredRate, IsNeverSurerThanItsTrials) {
  const std::vector<Count> alternating = {{1, 2}, {1, 2}, {1, 2}, {1, 2}};  // more even than chance: ICC below 0
  EXPECT_LT(*StatisticsOfClusters(alternating).icc, 0);
  EXPECT_EQ(*StatisticsOfClusters(alternating).effective_trials, 8);
}

TEST(ClusteredRate, GivesReasonsInsteadOfNumbersWhereNothingVaries) {
  EXPECT_EQ(StatisticsOfClusters({}).rate.reason(), "no trials");
  EXPECT_EQ(StatisticsOfClusters(std::vector<Count>{{2, 3}, {0, 0}}).cluster_se.reason(), "fewer than 2 clusters");
  EXPECT_EQ(StatisticsOfClusters(std::vector<Count>{{3, 3}, {3, 3}}).icc.reason(), "all outcomes are equal");
  EXPECT_EQ(StatisticsOfClusters(std::vector<Count>{{3, 3}, {3, 3}}).design_effect.reason(), "all outcomes are equal");
  EXPECT_EQ(ClusteredWilsonInterval(std::vector<Count>{{3, 3}, {3, 3}}).interval->low,
            WilsonInterval(2, 2).interval->low);
}

TEST(ClusteredRate, IsNoSurerWhereAllRepeatsAreAlikeThanWhereOneStateDiffers) {
  const std::vector<Count> alike(4, Count{25, 25}), one_differs = {{25, 25}, {25, 25}, {25, 25}, {0, 25}};
  const Estimate sure = ClusteredWilsonInterval(alike);
  EXPECT_EQ(sure.interval->low, WilsonInterval(4, 4).interval->low) << "four states, not a hundred trials";
  EXPECT_EQ(sure.method, "Wilson on effective trials");
  EXPECT_EQ(sure.n, 100);
  EXPECT_NEAR(ClusteredWilsonInterval(one_differs).interval->high, WilsonInterval(3, 4).interval->high, 1e-9);
}

TEST(ClusteredRate, OfOneStateIsThatOfOneTrialHoweverOftenItIsRepeated) {
  EXPECT_EQ(ClusteredWilsonInterval(std::vector<Count>{{10, 10}}).interval->low, WilsonInterval(1, 1).interval->low);
  const Estimate mixed = ClusteredWilsonInterval(std::vector<Count>{{70, 100}, {0, 0}});
  EXPECT_EQ(*mixed.value, 0.7);
  EXPECT_LT(mixed.interval->low, 0.2);
  const Estimate single = ClusteredWilsonInterval(std::vector<Count>{{1, 1}});
  EXPECT_EQ(single.method, "Wilson") << "nothing is repeated";
}

TEST(EffectiveCount, IsTheTrialsWithoutRepeatsAndTheClustersOfCopies) {
  const auto expect = [](const std::vector<Count>& clusters, std::int64_t successes, std::int64_t trials) {
    const Count count = EffectiveCount(clusters);
    EXPECT_EQ(count.successes, successes);
    EXPECT_EQ(count.trials, trials);
  };
  expect({{1, 1}, {0, 1}, {1, 1}}, 2, 3);
  expect({{5, 5}, {0, 5}, {5, 5}, {0, 5}, {5, 5}, {5, 5}}, 4, 6);
  expect({{25, 25}, {25, 25}}, 2, 2);
  expect({{1, 2}, {1, 2}, {1, 2}, {1, 2}}, 4, 8);
  expect({{7, 10}}, 1, 1);
  expect({}, 0, 0);
}

TEST(McNemar, DoesNotCareWhichWorldComesFirst) {
  for (const auto& [b, c] : {std::pair{0, 4}, {3, 9}, {5, 5}, {20, 21}}) {
    const McNemar one = McNemarExact({b, c}), other = McNemarExact({c, b});
    EXPECT_EQ(one.p_exact, other.p_exact);
    EXPECT_EQ(one.p_mid, other.p_mid);
    EXPECT_LE(one.p_mid, one.p_exact);
    EXPECT_LE(one.p_exact, 1);
  }
}

TEST(McNemar, FindsNoDifferenceWhereNoPairDisagreesOrBothDisagreeEquallyOften) {
  EXPECT_EQ(McNemarExact({0, 0}).p_exact, 1);
  EXPECT_EQ(McNemarExact({0, 0}).p_mid, 1);
  EXPECT_EQ(McNemarExact({0, 0}).chi2.reason(), "no pair disagrees");
  EXPECT_EQ(McNemarExact({6, 6}).p_exact, 1);
  EXPECT_EQ(McNemarExact({6, 6}).p_mid, 1);
  EXPECT_NEAR(McNemarExact({0, 5}).p_exact, 2.0 / 32, 1e-15);
  EXPECT_THROW(McNemarExact({-1, 2}), Error);
}

TEST(SpecialFunctions, InvertEachOtherAndRefuseWhatIsOutsideTheirDomain) {
  for (const double p : {1e-6, 0.1, 0.5, 0.975}) {
    EXPECT_NEAR(NormalCdf(NormalQuantile(p)), p, 1e-14);
    EXPECT_NEAR(BetaCdf(2.5, 7, BetaQuantile(p, 2.5, 7)), p, 1e-13);
  }
  EXPECT_NEAR(ChiSquareTail(1.96 * 1.96, 1), 2 * NormalCdf(-1.96), 1e-14);
  EXPECT_NEAR(StudentTwoSided(1, 1), 0.5, 1e-15);  // Cauchy
  EXPECT_NEAR(FairBinomialCdf(1, 3), 0.5, 1e-15);
  EXPECT_THROW(NormalQuantile(1), Error);
  EXPECT_THROW(BetaCdf(0, 1, 0.5), Error);
  EXPECT_THROW(ChiSquareTail(-1, 1), Error);
  EXPECT_THROW(TwoSidedZ(1), Error);
}

}  // namespace
}  // namespace evac
