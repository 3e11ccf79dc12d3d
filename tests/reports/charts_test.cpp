#include "reports/charts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/statistics/rates.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

std::size_t Times(const std::string& text, const std::string& part) {
  std::size_t times = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++times;
  return times;
}

TEST(RateStrip, PutsTheDotAtTheRateAndTheBarOnItsInterval) {
  const std::string svg = RateStrip(WilsonInterval(9, 10), 0);
  EXPECT_THAT(svg, HasSubstr("<svg x=\"90.00%\""));
  EXPECT_THAT(svg, HasSubstr("x1=\"59.58%\" x2=\"98.21%\""));
  EXPECT_THAT(svg, HasSubstr("aria-label=\"90 % [60, 98]\""));
}

TEST(RateStrip, DrawsNothingWhereThereIsNoRate) {
  const std::string svg = RateStrip(WilsonInterval(0, 0), 0);
  EXPECT_THAT(svg, Not(HasSubstr("class=\"range\"")));
  EXPECT_THAT(svg, Not(HasSubstr("class=\"dot\"")));
  EXPECT_THAT(svg, HasSubstr("undefined"));
}

TEST(Scatter, HasAMarkALetterAndTwoWhiskersForEveryPoint) {
  const WorldComparison comparison = LargeRun().Summary().comparisons.at(0);
  std::vector<PointStyle> styles;
  for (std::size_t i = 0; i < comparison.points.size(); ++i) styles.push_back({i % 4, i / 4});
  const std::string svg = Scatter(comparison, styles);
  EXPECT_EQ(Times(svg, "class=\"letter\""), 8u);
  EXPECT_EQ(Times(svg, "class=\"mark "), 8u);
  EXPECT_EQ(Times(svg, "class=\"whisker"), 8u);
  EXPECT_THAT(svg, HasSubstr("class=\"identity\""));
  EXPECT_THAT(svg, HasSubstr(": place_toast, pick@blind: real 10 %"));
}

TEST(Marker, ShapesDifferSoThatColourIsNotNeeded) {
  std::set<std::string> shapes;
  for (std::size_t i = 0; i < 8; ++i) shapes.insert(Marker(i, "mark"));
  EXPECT_EQ(shapes.size(), 8u);
}

}  // namespace
}  // namespace evac
