#include "apps/networks/painted_over.h"

#include <gtest/gtest.h>

namespace evac {
namespace {

constexpr int kWidth_px = 384, kHeight_px = 256;
const cv::Scalar kTable(150, 120, 90), kThing(36, 180, 91);

cv::Mat Painted(const cv::Rect& thing) {
  cv::Mat rgb(kHeight_px, kWidth_px, CV_8UC3, kTable), mask = cv::Mat::zeros(kHeight_px, kWidth_px, CV_8U);
  rgb(thing).setTo(kThing);
  mask(thing).setTo(255);
  return PaintedOver(rgb, mask);
}

double FurthestFromTable(const cv::Mat& rgb) { return cv::norm(rgb, cv::Mat(rgb.size(), CV_8UC3, kTable), cv::NORM_INF); }

TEST(PaintedOver, AThingLeavesNothingOfItselfHoweverWideItIs) {
  for (const int side_px : {6, 40, 80, 200})
    EXPECT_LE(FurthestFromTable(Painted({90, 20, side_px, side_px})), 1) << side_px << " px wide";
}

TEST(PaintedOver, AThingAtTheEdgeIsFilledFromInsideThePicture) {
  EXPECT_LE(FurthestFromTable(Painted({0, 0, 60, kHeight_px})), 1);
}

TEST(PaintedOver, WhatIsNotMaskedStaysAsItIs) {
  cv::Mat rgb(kHeight_px, kWidth_px, CV_8UC3), mask = cv::Mat::zeros(kHeight_px, kWidth_px, CV_8U);
  cv::RNG(3).fill(rgb, cv::RNG::UNIFORM, 0, 256);
  EXPECT_EQ(cv::norm(PaintedOver(rgb, mask), rgb, cv::NORM_INF), 0);
  mask(cv::Rect(100, 100, 50, 50)).setTo(255);
  const cv::Mat painted = PaintedOver(rgb, mask);
  EXPECT_EQ(cv::norm(painted.rowRange(0, 100), rgb.rowRange(0, 100), cv::NORM_INF), 0);
}

TEST(PaintedOver, APictureOfTheThingAloneIsGrey) {
  const cv::Mat painted = Painted({0, 0, kWidth_px, kHeight_px});
  EXPECT_EQ(cv::norm(painted, cv::Mat(painted.size(), CV_8UC3, cv::Scalar::all(128)), cv::NORM_INF), 0);
}

}  // namespace
}  // namespace evac
