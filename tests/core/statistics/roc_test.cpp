#include "core/statistics/roc.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

TEST(AreaUnderRoc, IsTheShareOfPairsInTheRightOrder) {
  const std::vector<double> scores = {0.1, 0.4, 0.35, 0.8};
  EXPECT_DOUBLE_EQ(*AreaUnderRoc(scores, std::vector<int>{0, 0, 1, 1}), 0.75);
  EXPECT_DOUBLE_EQ(*AreaUnderRoc(scores, std::vector<int>{0, 0, 0, 1}), 1);
  EXPECT_DOUBLE_EQ(*AreaUnderRoc(scores, std::vector<int>{1, 0, 0, 0}), 0);
}

TEST(AreaUnderRoc, CountsTiesAsHalf) {
  EXPECT_DOUBLE_EQ(*AreaUnderRoc(std::vector<double>{2, 2, 2, 2}, std::vector<int>{0, 1, 0, 1}), 0.5);
}

TEST(AreaUnderRoc, AgreesWithCountingAllPairs) {
  SplitMix64 random(4);
  std::vector<double> scores;
  std::vector<int> outcomes;
  for (int i = 0; i < 60; ++i) {
    outcomes.push_back(random.Uniform() < 0.4);
    scores.push_back(static_cast<double>(random.Below(12)) + 2 * outcomes.back());
  }
  double right = 0, pairs = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    for (std::size_t j = 0; j < scores.size(); ++j) {
      if (outcomes[i] != 1 || outcomes[j] != 0) continue;
      ++pairs;
      right += scores[i] > scores[j] ? 1 : scores[i] == scores[j] ? 0.5 : 0;
    }
  }
  EXPECT_NEAR(*AreaUnderRoc(scores, outcomes), right / pairs, 1e-12);
}

TEST(AreaUnderRoc, OfOneKindAloneIsUndefined) {
  EXPECT_FALSE(AreaUnderRoc(std::vector<double>{1, 2}, std::vector<int>{1, 1}));
  EXPECT_FALSE(AreaUnderRoc({}, {}));
}

TEST(AreaUnderRoc, RefusesWhatIsNoScoreOrOutcome) {
  EXPECT_THROW(AreaUnderRoc(std::vector<double>{1, 2}, std::vector<int>{1}), Error);
  EXPECT_THROW(AreaUnderRoc(std::vector<double>{1, NAN}, std::vector<int>{1, 0}), Error);
  EXPECT_THROW(AreaUnderRoc(std::vector<double>{1, 2}, std::vector<int>{1, 2}), Error);
}

}  // namespace
}  // namespace evac
