#include "core/statistics/threshold.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

double ImbalanceAt(const std::vector<double>& probabilities, const std::vector<int>& outcomes, double threshold) {
  const ConfusionStatistics s = StatisticsOf(ConfusionAt(probabilities, outcomes, threshold));
  return std::abs(*s.specificity.value - *s.sensitivity.value);
}

TEST(Threshold, ErrorsAreCountedOfEachOutcome) {
  const Confusion c = ConfusionAt(std::vector<double>{0.1, 0.5, 0.9, 0.4, 0.5}, std::vector<int>{0, 0, 0, 1, 1}, 0.5);
  EXPECT_EQ(c.both_failure + c.only_judge_success, 3);
  EXPECT_EQ(c.only_judge_success, 2) << "from the threshold on";
  EXPECT_EQ(c.both_success + c.only_human_success, 2);
  EXPECT_EQ(c.only_human_success, 1);
  const ConfusionStatistics s = StatisticsOf(c);
  EXPECT_DOUBLE_EQ(*s.specificity.value, 1 - 2.0 / 3);
  EXPECT_DOUBLE_EQ(*s.sensitivity.value, 1.0 / 2);
  EXPECT_DOUBLE_EQ(*s.accuracy, 2.0 / 5);
}

TEST(Threshold, NoShareOfNothing) {
  const ConfusionStatistics s = StatisticsOf(ConfusionAt(std::vector<double>{0.1}, std::vector<int>{0}, 0.5));
  EXPECT_FALSE(s.sensitivity.value);
  EXPECT_DOUBLE_EQ(*s.accuracy, 1);
  EXPECT_FALSE(StatisticsOf(ConfusionAt({}, {}, 0.5)).accuracy);
}

TEST(BalancedThreshold, NoOtherIsMoreBalanced) {
  SplitMix64 random(11);
  for (int round = 0; round < 30; ++round) {
    std::vector<double> probabilities;
    std::vector<int> outcomes;
    for (int i = 0; i < 150; ++i) {
      outcomes.push_back(random.Uniform() < 0.4);
      // Some of them hundredths, which lie on thresholds.
      const double probability = std::clamp(0.55 + 0.3 * (outcomes.back() - 0.5) + 0.25 * random.Normal(), 0.0, 1.0);
      probabilities.push_back(i % 3 == 0 ? std::round(100 * probability) / 100 : probability);
    }
    const double found = *BalancedThreshold(probabilities, outcomes);
    for (int hundredth = 5; hundredth <= 95; ++hundredth) {
      const double threshold = hundredth / 100.0;
      const double imbalance = ImbalanceAt(probabilities, outcomes, threshold);
      EXPECT_LE(ImbalanceAt(probabilities, outcomes, found), imbalance + 1e-12);
      if (std::abs(threshold - 0.5) < std::abs(found - 0.5) - 1e-9) {
        EXPECT_LT(ImbalanceAt(probabilities, outcomes, found), imbalance - 1e-12) << "the one next to .5 is taken";
      }
    }
  }
}

TEST(BalancedThreshold, WhereNothingIsMistakenItStaysInTheMiddle) {
  EXPECT_DOUBLE_EQ(*BalancedThreshold(std::vector<double>{0, 0.1, 0.9, 1}, std::vector<int>{0, 0, 1, 1}), 0.5);
}

TEST(BalancedThreshold, MovesAgainstAnOptimist) {
  // A judge that says .7 of half of the failures and .8 of all successes.
  std::vector<double> probabilities;
  std::vector<int> outcomes;
  for (int i = 0; i < 40; ++i) {
    outcomes.push_back(i % 2);
    probabilities.push_back(i % 2 == 1 ? 0.8 : i % 4 == 0 ? 0.7 : 0.1);
  }
  EXPECT_DOUBLE_EQ(*BalancedThreshold(probabilities, outcomes), 0.71);
}

TEST(BalancedThreshold, IsUndefinedOfOneKind) {
  EXPECT_FALSE(BalancedThreshold(std::vector<double>{0.3, 0.4}, std::vector<int>{1, 1}));
  EXPECT_FALSE(BalancedThreshold({}, {}));
}

TEST(BalancedThreshold, RefusesWhatIsNoProbability) {
  EXPECT_THROW(BalancedThreshold(std::vector<double>{1.5}, std::vector<int>{1}), Error);
  EXPECT_THROW(BalancedThreshold(std::vector<double>{std::nan("")}, std::vector<int>{1}), Error);
  EXPECT_THROW(BalancedThreshold(std::vector<double>{0.5}, std::vector<int>{2}), Error);
  EXPECT_THROW(BalancedThreshold(std::vector<double>{0.5}, std::vector<int>{}), Error);
}

}  // namespace
}  // namespace evac
