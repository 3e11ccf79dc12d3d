#include <deque>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/geometry.h"
#include "core/recording.h"
#include "core/video.h"

namespace evac {
namespace {

/// A mean over `shrink` x `shrink` pixels.
cv::Mat Shrunk(const cv::Mat& image, int shrink) {
  if (shrink == 1) return image;
  cv::Mat small;
  cv::resize(image, small, {image.cols / shrink, image.rows / shrink}, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace

struct RecordedFrames::Walk {
  std::vector<std::filesystem::path> paths;
  std::deque<VideoReader> videos;  // which stay where they are: a reader cannot be moved
  std::vector<cv::Mat> images;
  std::size_t steps = 0, next = 0;
  int every_nth = 1, shrink = 1;

  /// Decodes up to the frame of step `next`.
  void Read(std::size_t camera) {
    for (int skipped = next == 0 ? every_nth - 1 : 0; skipped < every_nth; ++skipped) {
      images[camera] = videos[camera].Next();
      if (images[camera].empty())
        throw InvalidInput("{}: the video ends before step {} of {}", paths[camera].string(), next, steps)
            .Called("short_video");
    }
    images[camera] = Shrunk(images[camera], shrink);
  }
};

Recording Shrunk(Recording recording, int shrink) {
  for (cv::Mat& image : recording.first_images) image = Shrunk(image, shrink);
  for (Camera& camera : recording.cameras)
    camera = Resized(camera, camera.width_px / shrink, camera.height_px / shrink);
  recording.shrink *= shrink;
  return recording;
}

RecordedFrames::RecordedFrames(const Recording& recording) : walk_(std::make_unique<Walk>()) {
  walk_->paths = recording.videos;
  for (const auto& path : recording.videos) walk_->videos.emplace_back(path);
  walk_->images = recording.first_images;
  walk_->steps = recording.arms.size();
  walk_->every_nth = recording.every_nth;
  walk_->shrink = recording.shrink;
}
RecordedFrames::~RecordedFrames() = default;
RecordedFrames::RecordedFrames(RecordedFrames&&) noexcept = default;
RecordedFrames& RecordedFrames::operator=(RecordedFrames&&) noexcept = default;

const std::vector<cv::Mat>& RecordedFrames::Next() {
  if (walk_->next < walk_->steps) {
    for (std::size_t camera = 0; camera < walk_->videos.size(); ++camera) walk_->Read(camera);
    ++walk_->next;
  }
  return walk_->images;
}

}  // namespace evac
