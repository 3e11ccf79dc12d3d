#include "reports/rates_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

std::vector<CorrelationGroup> Groups(const std::vector<CorrelationPoint>& points) { return CorrelatePoints(points); }

TEST(RatesPage, ShowsEveryGroupWithItsNumbersAndPoints) {
  const std::string page = RatesPage(Groups({{"cans", "pick", "rt1", 0.9, 0.8, {}, {}},
                                             {"cans", "pick", "rt2", 0.5, 0.6, {}, {}},
                                             {"cans", "pick", "octo", 0.1, 0.1, {}, {}},
                                             {"cans", "pick", "vla", 0.3, 0.2, {}, {}},
                                             {"two", "lift", "rt1", 0.9, 0.8, {}, {}},
                                             {"two", "lift", "rt2", 0.5, 0.6, {}, {}}}),
                                     "published.csv", "evac test");
  EXPECT_THAT(page, HasSubstr("published.csv · 2 groups · 6 points"));
  EXPECT_THAT(page, HasSubstr("0.96 <span class=\"ci\">[-0.01, 0.999]"));
  EXPECT_THAT(page, HasSubstr("wanted at least 3")) << "two points have no correlation, and the page says why";
  EXPECT_THAT(page, HasSubstr(">octo <"));
  EXPECT_THAT(page, Not(HasSubstr("interval undefined"))) << "said once, not in every cell";
  EXPECT_THAT(page, HasSubstr("script-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
}

TEST(RatesPage, NamesAreTextAndNothingElse) {
  const std::string page =
      RatesPage(Groups({{"<script>g", "\"t", "<img src=x>", 0.9, 0.8, {}, {}}}), "<b>.csv", "evac test");
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("<img")));
  EXPECT_THAT(page, Not(HasSubstr("<b>.csv")));
}

TEST(RatesPage, RatesOutsideOfTheChartAreNotDrawnIntoIt) {
  const std::vector<CorrelationGroup> groups = Groups({{"scores", "a", "1", 0.9, 80, {}, {}},
                                                       {"scores", "a", "2", 0.5, 60, {}, {}},
                                                       {"rates", "a", "1", 0.9, 0.8, {}, {}}});
  EXPECT_THAT(RatesPage(groups, "x.csv", "evac test"), HasSubstr("No chart: a rate is outside of 0 to 100 %"));
  ASSERT_THAT(ChartFilesOf(groups), SizeIs(1));
  EXPECT_EQ(ChartFilesOf(groups).front().name, "rates");
}

}  // namespace
}  // namespace evac
