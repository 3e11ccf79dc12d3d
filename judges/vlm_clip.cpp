#include "judges/vlm_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/error.h"
#include "core/video.h"

namespace evac {
namespace {

constexpr int kPatch_px = 28;

void AddUniform(int first, int last, int count, std::set<int>& picked) {
  for (int i = 0; i < count; ++i) {
    const double share = count == 1 ? 1 : static_cast<double>(i) / (count - 1);
    picked.insert(first + static_cast<int>(std::lround(share * (last - first))));
  }
}

/// Views stand side by side in the task's order, all enlarged by the same factor.
cv::Mat MainView(const cv::Mat& frame, const Task& task) {
  if (task.cameras.empty()) return frame;
  int width_px = 0;
  for (const Camera& camera : task.cameras) width_px += camera.width_px;
  const double scale = std::max(1.0, std::floor(static_cast<double>(frame.cols) / width_px));
  const cv::Rect view(0, 0, static_cast<int>(scale * task.cameras[0].width_px),
                      static_cast<int>(scale * task.cameras[0].height_px));
  return frame(view & cv::Rect(0, 0, frame.cols, frame.rows));
}

cv::Mat Resized(const cv::Mat& image, int long_side_px) {
  const double scale = static_cast<double>(long_side_px) / std::max(image.cols, image.rows);
  cv::Mat resized;
  cv::resize(image, resized, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  return resized;
}

/// White on a dark strip below the picture, so that it hides nothing.
cv::Mat Captioned(const cv::Mat& image, const std::string& caption) {
  constexpr int kStrip_px = 24;
  cv::Mat captioned;
  cv::copyMakeBorder(image, captioned, 0, kStrip_px, 0, 0, cv::BORDER_CONSTANT, cv::Scalar::all(20));
  cv::putText(captioned, caption, {6, captioned.rows - 7}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar::all(255), 1,
              cv::LINE_AA);
  return captioned;
}

std::string Jpeg(const cv::Mat& rgb, int quality) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::string VlmFrame::Caption() const { return fmt::format("t={:.1f}s (frame {})", time_s, number); }

std::vector<int> PickFrames(int count, const VlmClipOptions& options) {
  if (count < 1) throw InvalidInput("the video has {} frames, wanted 1 or more", count);
  if (options.frames < 1 || options.tail_frames < 0)
    throw InvalidInput("frames is {} and tail_frames {}, wanted at least 1 and 0", options.frames, options.tail_frames);
  std::set<int> picked;
  AddUniform(0, count - 1, options.frames, picked);
  AddUniform((count - 1) - (count - 1) / 4, count - 1, options.tail_frames, picked);
  return {picked.begin(), picked.end()};
}

std::vector<VlmFrame> ReadVlmFrames(const std::filesystem::path& video, const Task& task,
                                    const VlmClipOptions& options) {
  const std::vector<cv::Mat> all = ReadAllFrames(video);
  std::vector<VlmFrame> frames;
  for (const int number : PickFrames(static_cast<int>(all.size()), options)) {
    VlmFrame frame{.number = number, .time_s = number * task.period_s};
    const cv::Mat image = Captioned(Resized(MainView(all[number], task), options.long_side_px), frame.Caption());
    frame.width_px = image.cols;
    frame.height_px = image.rows;
    frame.jpeg = Jpeg(image, options.jpeg_quality);
    frames.push_back(std::move(frame));
  }
  return frames;
}

long EstimatedTokens(const std::vector<VlmFrame>& frames) {
  long tokens = 0;
  for (const VlmFrame& frame : frames) {
    const auto patches = [](int side_px) { return (side_px + kPatch_px - 1) / kPatch_px; };
    tokens += static_cast<long>(patches(frame.width_px)) * patches(frame.height_px);
  }
  return tokens;
}

}  // namespace evac
