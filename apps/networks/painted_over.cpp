#include "apps/networks/painted_over.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace evac {

cv::Mat PaintedOver(const cv::Mat& rgb, const cv::Mat& mask) {
  constexpr int kAround_px = 31;
  constexpr double kLeastSeen = 0.05;
  cv::Mat seen, seen_rgb, picture, filled = rgb.clone();
  cv::Mat(mask == 0).convertTo(seen, CV_32F, 1.0 / 255);
  cv::cvtColor(seen, seen_rgb, cv::COLOR_GRAY2BGR);
  rgb.convertTo(picture, CV_32F);
  picture = picture.mul(seen_rgb);
  cv::Mat left = mask != 0;
  const int whole_px = 2 * std::max(rgb.cols, rgb.rows);
  for (int side_px = kAround_px; cv::countNonZero(left) > 0 && side_px <= 2 * whole_px; side_px = 2 * side_px + 1) {
    const auto mean = [&](const cv::Mat& of) {  // what lies beyond the picture is not seen either
      cv::Mat about;
      cv::boxFilter(of, about, CV_32F, {side_px, side_px}, {-1, -1}, true, cv::BORDER_CONSTANT);
      return about;
    };
    const cv::Mat share = mean(seen), told = (share >= kLeastSeen) & left;
    cv::Mat divisor, around;
    cv::cvtColor(cv::max(share, kLeastSeen), divisor, cv::COLOR_GRAY2BGR);
    cv::divide(mean(picture), divisor, around);
    around.convertTo(around, CV_8U);
    around.copyTo(filled, told);
    left.setTo(0, told);
  }
  filled.setTo(cv::Scalar::all(128), left);
  return filled;
}

}  // namespace evac
