#include "core/video.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace evac {

std::vector<cv::Mat> ReadAllFrames(const std::filesystem::path& path) {
  VideoReader reader(path);
  std::vector<cv::Mat> frames;
  for (cv::Mat frame = reader.Next(); !frame.empty(); frame = reader.Next()) frames.push_back(frame);
  return frames;
}

cv::Mat SideBySide(const std::vector<cv::Mat>& images) {
  if (images.empty()) throw InternalError("an observation without images has no picture");
  int height_px = 0;
  for (const cv::Mat& image : images) height_px = std::max(height_px, image.rows);
  std::vector<cv::Mat> padded;
  for (const cv::Mat& image : images) {
    cv::copyMakeBorder(image, padded.emplace_back(), 0, height_px - image.rows, 0, 0, cv::BORDER_CONSTANT);
  }
  cv::Mat together;
  cv::hconcat(padded, together);
  return together;
}

}  // namespace evac
