#include "reports/chart_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <set>

#include "core/error.h"
#include "reports/png.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

std::vector<ChartFile> LargeCharts() { return ChartFilesOf(ReportDataOf(LargeRun().Summary())); }

TEST(ChartFiles, ThereIsOneForEveryChartOfThePageUnderANameOfItsOwn) {
  std::set<std::string> names, kinds;
  for (const ChartFile& chart : LargeCharts()) {
    EXPECT_TRUE(names.insert(chart.name).second) << chart.name;
    kinds.insert(chart.name.substr(0, chart.name.find('-')));
    EXPECT_THAT(chart.name, testing::MatchesRegex("[-A-Za-z0-9_]+"));
  }
  EXPECT_THAT(kinds, testing::ElementsAre("checkpoints", "rates", "stages", "states", "trust", "worlds"));
  EXPECT_EQ(names.size(), 2u + 2u + 8u + 8u + 1u + 1u);
}

TEST(ChartFiles, NeedNothingFromOutside) {
  for (const ChartFile& chart : LargeCharts()) {
    EXPECT_THAT(chart.svg, testing::StartsWith("<?xml"));
    for (const char* outside : {"var(", "url(", "href=", "<script", "<image", "@import"})
      EXPECT_THAT(chart.svg, Not(HasSubstr(outside))) << chart.name;
  }
}

/// The judge's name ran out of the picture in three kinds of charts.
TEST(ChartFiles, WhatStandsAboveAChartEndsBeforeItsRightMargin) {
  ReportData report = ReportDataOf(LargeRun().Summary());
  for (const char* judge : {"oracle", "classifier:0123456789ab",
                            "vlm:some-model-of-a-server-whose-name-is-long-72b-0123456789ab:small"}) {
    report.summary.options.judge = judge;
    for (const ChartFile& chart : ChartFilesOf(report)) {
      EXPECT_THAT(chart.svg, HasSubstr(">judge " + std::string(judge) + "</text>")) << chart.name << ": on a line of its own";
      const std::string png = PngOf(chart.svg, 1);
      const cv::Mat grey = cv::imdecode(cv::Mat(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data())),
                                        cv::IMREAD_GRAYSCALE);
      double darkest = 0;
      cv::minMaxLoc(grey.colRange(grey.cols - 4, grey.cols), &darkest, nullptr);
      EXPECT_EQ(darkest, 255) << chart.name << ", " << judge;
    }
  }
}

TEST(ChartFiles, HostileNamesAreLettersAndStayApart) {
  const SampleRun run({{"a b", "<pick>", "1", "s", "s"}, {"a_b", "<pick>", "1", "s", "f"}});
  std::set<std::string> names;
  for (const ChartFile& chart : ChartFilesOf(ReportDataOf(run.Summary()))) {
    EXPECT_THAT(chart.name, testing::MatchesRegex("[-A-Za-z0-9_]+"));
    EXPECT_TRUE(names.insert(chart.name).second) << chart.name;
  }
  EXPECT_EQ(names.count("rates-a_b"), 1u);
  EXPECT_EQ(names.count("rates-a_b-2"), 1u);
}

TEST(Png, IsThePictureOfItsSvgAndTheSameEveryTime) {
  const std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20\" height=\"10\"><rect width=\"10\" height=\"10\" "
      "fill=\"#f00\"/>"
      "<rect x=\"10\" width=\"10\" height=\"10\" fill=\"#00f\"/></svg>";
  const std::string png = PngOf(svg, 3);
  EXPECT_EQ(png, PngOf(svg, 3));
  const cv::Mat bgr =
      cv::imdecode(cv::Mat(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data())), cv::IMREAD_COLOR);
  ASSERT_EQ(bgr.size(), cv::Size(60, 30));
  EXPECT_EQ(bgr.at<cv::Vec3b>(15, 15), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(bgr.at<cv::Vec3b>(15, 45), cv::Vec3b(255, 0, 0));
}

TEST(Png, EveryChartCanBeDrawnAndIsNotEmpty) {
  for (const ChartFile& chart : LargeCharts()) {
    const std::string png = PngOf(chart.svg, 1);
    const cv::Mat grey = cv::imdecode(cv::Mat(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data())),
                                      cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(grey.empty()) << chart.name;
    double darkest = 255, lightest = 0;
    cv::minMaxLoc(grey, &darkest, &lightest);
    EXPECT_LT(darkest, 100) << chart.name << " has ink";
    EXPECT_EQ(lightest, 255) << chart.name << " has a white ground";
  }
}

TEST(Png, WhatIsNoSvgIsRefused) {
  EXPECT_THROW(PngOf("no svg"), Error);
  EXPECT_THROW(PngOf("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"1\"/>", 0), Error);
}

}  // namespace
}  // namespace evac
