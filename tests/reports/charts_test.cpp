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

Estimate BiasOf(double value, double low, double high) {
  Estimate bias;
  bias.value = value;
  bias.interval = Interval{low, high};
  return bias;
}

/// [-56, 56] was drawn as [-50, 50], with a cap where the scale ends.
TEST(BiasStrip, WhereTheScaleEndsBeforeTheBarThereIsAnArrowAndNoCap) {
  const std::string cap = "m0-4v8", left = "m5-4l-5 4l5 4", right = "m-5-4l5 4l-5 4";
  const std::string beyond = BiasStrip(BiasOf(0, -0.56, 0.56), 0.1, 1), within = BiasStrip(BiasOf(0, -0.5, 0.5), 0.1, 1);
  EXPECT_THAT(beyond, testing::AllOf(HasSubstr(left), HasSubstr(right), Not(HasSubstr(cap))));
  EXPECT_THAT(within, testing::AllOf(Not(HasSubstr(left)), Not(HasSubstr(right))));
  EXPECT_EQ(Times(within, cap), 2u);
  EXPECT_THAT(within, HasSubstr("class=\"dot\""));
  EXPECT_THAT(BiasStrip(BiasOf(0.7, 0.2, 0.9), 0.1, 1), Not(HasSubstr("class=\"dot\""))) << "70 points are not 50";
}

/// The same in the chart's file.
TEST(Rows, WhereTheAxisEndsBeforeTheBarThereIsAnArrowAndNoCap) {
  RowChart chart;
  chart.low = -0.5;
  chart.high = 0.5;
  chart.rows.push_back({"take", "0 points", BiasOf(0, -0.56, 0.3), 1, false});
  const std::string svg = RowsDrawing(chart).body;
  EXPECT_EQ(Times(svg, "m5-4l-5 4l5 4"), 1u);
  EXPECT_EQ(Times(svg, "m0-4v8"), 1u);
  EXPECT_EQ(Times(svg, "class=\"dot\""), 1u);
  chart.rows[0].estimate = BiasOf(-0.7, -0.9, -0.6);
  EXPECT_EQ(Times(RowsDrawing(chart).body, "class=\"dot\""), 0u);
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

TEST(Columns, OfManySomeAreNamedInFullInsteadOfAllByNothing) {
  CheckpointCurve curve{"take", "pick", true, {"real"}, {}, {}};
  for (int step = 0; step < 50; ++step)
    curve.points.push_back({"step_" + std::to_string(1000 + step), 1000.0 + step, {WilsonInterval(1, 2)}});
  const std::string svg = CheckpointDrawing(curve, {{"real", 0}}).body;
  EXPECT_THAT(svg, Not(HasSubstr("…")));
  EXPECT_THAT(svg, HasSubstr(">step_1000</text>"));
  EXPECT_GE(Times(svg, ">step_"), 7u);
  EXPECT_LE(Times(svg, ">step_"), 9u);
  curve.points.resize(3);
  EXPECT_EQ(Times(CheckpointDrawing(curve, {{"real", 0}}).body, ">step_"), 3u) << "of few all are named";
}

}  // namespace
}  // namespace evac
