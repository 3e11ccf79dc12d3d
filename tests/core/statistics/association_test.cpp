#include "core/statistics/association.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/mmrv.h"
#include "core/statistics/rate_agreement.h"

namespace evac {
namespace {

using testing::ElementsAre;

/// Rates on a grid of tenths, so that ties are frequent.
RatePairs RandomPairs(std::uint64_t seed, int n) {
  SplitMix64 random(seed);
  RatePairs pairs;
  for (int i = 0; i < n; ++i) {
    pairs.real.push_back(static_cast<double>(random.Below(11)) / 10);
    pairs.sim.push_back(static_cast<double>(random.Below(11)) / 10);
  }
  return pairs;
}

RatePairs Reversed(RatePairs pairs) {
  std::ranges::reverse(pairs.real);
  std::ranges::reverse(pairs.sim);
  return pairs;
}

constexpr MmrvConvention kConventions[] = {{MmrvGap::kReal, MmrvTies::kCode}, {MmrvGap::kReal, MmrvTies::kSign},
                                           {MmrvGap::kReal, MmrvTies::kLeq},  {MmrvGap::kReal, MmrvTies::kLess},
                                           {MmrvGap::kSim, MmrvTies::kCode},  {MmrvGap::kSim, MmrvTies::kSign},
                                           {MmrvGap::kSim, MmrvTies::kLeq},   {MmrvGap::kSim, MmrvTies::kLess}};

TEST(Association, DoesNotDependOnTheOrderOfThePointsNorOnWhichWorldComesFirst) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const RatePairs pairs = RandomPairs(seed, 8), reversed = Reversed(pairs);
    EXPECT_NEAR(*Pearson(pairs.real, pairs.sim).value, *Pearson(reversed.real, reversed.sim).value, 1e-12);
    EXPECT_NEAR(*Pearson(pairs.real, pairs.sim).value, *Pearson(pairs.sim, pairs.real).value, 1e-12);
    EXPECT_NEAR(*Spearman(pairs.real, pairs.sim).value, *Spearman(reversed.sim, reversed.real).value, 1e-12);
    EXPECT_EQ(*KendallTauB(pairs.real, pairs.sim).tau_b, *KendallTauB(reversed.sim, reversed.real).tau_b);
    for (const MmrvConvention& convention : kConventions) {
      EXPECT_NEAR(*Mmrv(pairs, convention).mmrv, *Mmrv(reversed, convention).mmrv, 1e-12) << Name(convention);
    }
  }
}

TEST(Association, StaysInItsRangeAndItsIntervalHoldsIt) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const RatePairs pairs = RandomPairs(seed, 9);
    for (const Estimate& r : {Pearson(pairs.real, pairs.sim), Spearman(pairs.real, pairs.sim)}) {
      EXPECT_LE(-1, r.interval->low);
      EXPECT_LE(r.interval->low, *r.value);
      EXPECT_LE(*r.value, r.interval->high);
      EXPECT_LE(r.interval->high, 1);
    }
  }
}

TEST(Pearson, IsUnchangedByScaleAndShiftAndExactlyOneOnALine) {
  const RatePairs pairs = RandomPairs(3, 7);
  std::vector<double> scaled, on_a_line;
  for (const double x : pairs.real) {
    scaled.push_back(-3 * x + 40);
    on_a_line.push_back(0.7 * x + 0.1);
  }
  EXPECT_NEAR(*Pearson(scaled, pairs.sim).value, -*Pearson(pairs.real, pairs.sim).value, 1e-12);
  EXPECT_EQ(*Pearson(pairs.real, on_a_line).value, 1);
  EXPECT_FALSE(Pearson(pairs.real, on_a_line).interval);
  EXPECT_EQ(*Pearson(pairs.real, scaled).value, -1);
  EXPECT_FALSE(PearsonPValue(Pearson(pairs.real, scaled)));
}

TEST(Pearson, IsUndefinedForEqualValuesEvenWhereRoundingHidesIt) {
  const std::vector<double> tenths(10, 0.1), rising = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};  // ten times 0.1 sum to no 1
  EXPECT_EQ(Pearson(tenths, rising).value.reason(), "all values of the first sequence are equal");
  EXPECT_EQ(Pearson(rising, tenths).value.reason(), "all values of the second sequence are equal");
  EXPECT_FALSE(Spearman(tenths, rising).value);
  EXPECT_FALSE(KendallTauB(tenths, rising).tau_b);
  EXPECT_FALSE(Pearson(tenths, rising).interval);
}

TEST(Pearson, IsUndefinedForOnePointAndHasNoIntervalForThree) {
  EXPECT_EQ(Pearson({}, {}).value.reason(), "no points");
  const std::vector<double> one = {0.5}, x = {0.1, 0.5, 0.9}, y = {0.2, 0.4, 0.9};
  EXPECT_EQ(Pearson(one, one).value.reason(), "only one point");
  EXPECT_TRUE(Pearson(x, y).value);
  EXPECT_EQ(Pearson(x, y).interval.reason(), "fewer than 4 points");
}

TEST(Pearson, BearsTheLargestAndRefusesWhatIsNoNumber) {
  const double huge = std::numeric_limits<double>::max();
  const std::vector<double> x = {-huge, 0, huge, 1}, y = {-1, 0, 1, 0};
  EXPECT_NEAR(*Pearson(x, y).value, 1, 1e-12);
  const std::vector<double> nan = {1, 2, std::numeric_limits<double>::quiet_NaN(), 4}, shorter = {1, 2};
  EXPECT_THROW(Pearson(x, nan), Error);
  EXPECT_THROW(Pearson(x, shorter), Error);
  EXPECT_THROW(Mmrv({.real = x, .sim = shorter}), Error);
}

TEST(Spearman, IsPearsonOfRanksAndSeesOnlyOrder) {
  EXPECT_THAT(AverageRanks(std::vector<double>{5, 3, 5, 9}), ElementsAre(2.5, 1, 2.5, 4));
  const std::vector<double> x = {0.1, 0.2, 0.3, 0.9}, y = {0.01, 0.02, 0.9, 0.95};
  EXPECT_EQ(*Spearman(x, y).value, 1);
}

TEST(Mmrv, IsZeroExactlyWhereTheRanksAgree) {
  const RatePairs agree{.real = {0.1, 0.5, 0.5, 0.9}, .sim = {0.2, 0.3, 0.3, 0.4}};
  const RatePairs disagree{.real = {0.1, 0.5, 0.5, 0.9}, .sim = {0.3, 0.2, 0.2, 0.4}};
  for (const MmrvConvention& convention : kConventions) {
    EXPECT_EQ(*Mmrv(agree, convention).mmrv, 0) << Name(convention);
    EXPECT_GT(*Mmrv(disagree, convention).mmrv, 0) << Name(convention);
  }
}

TEST(Mmrv, TheGapOfSimIsTheGapOfRealWithTheWorldsSwapped) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const RatePairs pairs = RandomPairs(seed, 6), swapped{.real = pairs.sim, .sim = pairs.real};
    for (const MmrvTies ties : {MmrvTies::kCode, MmrvTies::kSign, MmrvTies::kLeq, MmrvTies::kLess}) {
      EXPECT_EQ(*Mmrv(pairs, {MmrvGap::kSim, ties}).mmrv, *Mmrv(swapped, {MmrvGap::kReal, ties}).mmrv);
    }
  }
}

TEST(Mmrv, TheConventionsDifferOnlyWhereRatesAreTied) {
  int without_ties = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const RatePairs pairs = RandomPairs(seed, 5);
    const MmrvResult code = Mmrv(pairs), sign = Mmrv(pairs, {MmrvGap::kReal, MmrvTies::kSign});
    EXPECT_EQ(*code.mmrv, *Mmrv(pairs, {MmrvGap::kReal, MmrvTies::kLeq}).mmrv);  // a <= b is !(a > b)
    EXPECT_LE(*sign.mmrv, *code.mmrv);
    if (code.ties > 0) continue;
    EXPECT_EQ(*code.mmrv, *sign.mmrv);
    EXPECT_EQ(*code.mmrv, *Mmrv(pairs, {MmrvGap::kReal, MmrvTies::kLess}).mmrv);
    ++without_ties;
  }
  EXPECT_GT(without_ties, 0);
}

TEST(Mmrv, CountsTiesAndMeasuresItselfAgainstTheRangeOfRealRates) {
  const MmrvResult result = Mmrv({.real = {0.2, 0.2, 0.6}, .sim = {0.5, 0.1, 0.1}});
  EXPECT_EQ(result.ties_real, 1);
  EXPECT_EQ(result.ties_sim, 1);
  EXPECT_EQ(result.ties, 2);
  EXPECT_NEAR(*result.over_range, *result.mmrv / 0.4, 1e-12);
  const MmrvResult equal = Mmrv({.real = {0.2, 0.2}, .sim = {0.5, 0.1}});
  EXPECT_EQ(equal.over_range.reason(), "all real rates are equal");
}

TEST(RateAgreement, IsPerfectForEqualWorldsAndNamesAShift) {
  const RatePairs equal{.real = {0.1, 0.5, 0.8}, .sim = {0.1, 0.5, 0.8}},
      kinder{.real = {0.1, 0.5, 0.8}, .sim = {0.2, 0.6, 0.9}};
  EXPECT_NEAR(*AgreementOf(equal).ccc, 1, 1e-12);
  EXPECT_EQ(*AgreementOf(equal).rmse, 0);
  EXPECT_NEAR(*AgreementOf(kinder).bias, 0.1, 1e-12);
  EXPECT_LT(*AgreementOf(kinder).ccc, 1);
  EXPECT_FALSE(AgreementOf({}).bias);
  EXPECT_FALSE(AgreementOf({.real = {0.5, 0.5}, .sim = {0.5, 0.5}}).ccc);
  EXPECT_EQ(*AgreementOf({.real = {0.5, 0.5}, .sim = {0.1, 0.1}}).ccc, 0);
}

}  // namespace
}  // namespace evac
