#include "core/statistics/two_samples.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/error.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/two_by_two.h"

namespace evac {
namespace {

/// As many initial states, tried once each.
std::vector<Count> Once(std::int64_t successes, std::int64_t trials) {
  std::vector<Count> states(static_cast<std::size_t>(trials), Count{0, 1});
  for (std::int64_t i = 0; i < successes; ++i) states[static_cast<std::size_t>(i)].successes = 1;
  return states;
}

TEST(TwoSamples, FewAreTestedExactly) {
  const TwoSampleTest test = BoschlooOrNewcombe(Once(9, 12), Once(3, 11));
  const ExactTest exact = BoschlooExact({9, 12}, {3, 11});
  EXPECT_EQ(test.method, "Boschloo");
  EXPECT_EQ(test.two_sided, exact.two_sided);
  EXPECT_EQ(test.greater, exact.greater);
  EXPECT_EQ(test.less, exact.less);
}

TEST(TwoSamples, MoreThanAnExactTestTakesAreTestedByTheirInterval) {
  const Count first{1800, 3000}, second{1155, 2100};
  EXPECT_THROW(BoschlooExact(first, second), Error);
  const TwoSampleTest test = BoschlooOrNewcombe(Once(1800, 3000), Once(1155, 2100));
  EXPECT_EQ(test.method, "Newcombe");
  EXPECT_LT(test.two_sided, 0.001);
  EXPECT_EQ(test.less, 1);
  EXPECT_NEAR(NewcombeDifference(first, second, 1 - test.two_sided).interval->low, 0, 1e-9);
  const TwoSampleTest back = BoschlooOrNewcombe(Once(1155, 2100), Once(1800, 3000));
  EXPECT_NEAR(back.two_sided, test.two_sided, 1e-12);
  EXPECT_NEAR(back.less, test.greater, 1e-12);
}

TEST(TwoSamples, BothTestsSayNearlyTheSameWhereOneTakesOver) {
  const TwoSampleTest test = BoschlooOrNewcombe(Once(265, 500), Once(300, 501));
  EXPECT_EQ(test.method, "Newcombe");
  const double exact = BoschlooExact({265, 500}, {300, 501}).two_sided;
  EXPECT_NEAR(test.two_sided, exact, 0.1 * exact);
}

TEST(TwoSamples, RepeatsOfOneStateDoNotMakeThemMany) {
  std::vector<Count> first, second;
  for (int state = 0; state < 20; ++state) {  // always the same outcome: sixty times the same twenty states
    first.push_back({state < 10 ? 60 : 0, 60});
    second.push_back({state < 3 ? 60 : 0, 60});
  }
  const TwoSampleTest test = BoschlooOrNewcombe(first, second);
  EXPECT_EQ(test.method, "Boschloo");
  EXPECT_EQ(test.two_sided, BoschlooExact({10, 20}, {3, 20}).two_sided);
}

TEST(TwoSamples, NoTrialsProveNothing) {
  EXPECT_EQ(BoschlooOrNewcombe({}, Once(3, 3)).two_sided, 1);
  EXPECT_EQ(BoschlooOrNewcombe(Once(2000, 2000), {}).two_sided, 1);
}

}  // namespace
}  // namespace evac
