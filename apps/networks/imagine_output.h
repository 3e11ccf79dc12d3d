#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "core/video.h"

namespace evac {

/// What stands in for a folder of pictures while it is written, FOLDER.tmp, holds new/ and old/ alone.
/// @throws InvalidInput naming the folder, or that one, if it is there and holds anything but frame_%05d.png, or is a
/// link: it is somebody's, and would go
void RequireOwnPictures(const std::filesystem::path& folder);

/// A folder of pictures that appears whole: filled beside its place, put there by Finish in place of what was there.
/// Destroyed before that, nothing has changed.
class PictureFolder {
 public:
  /// @throws InvalidInput as RequireOwnPictures; so does Finish.
  explicit PictureFolder(std::filesystem::path folder);
  ~PictureFolder();
  PictureFolder(const PictureFolder&) = delete;
  PictureFolder& operator=(const PictureFolder&) = delete;

  /// frame_00000.png, frame_00001.png, … @param rgb  CV_8UC3 RGB
  /// @throws Error if it cannot be written.
  void Append(const cv::Mat& rgb);
  void Finish();

 private:
  std::filesystem::path folder_, partial_;
  int count_ = 0;
};

/// One frame of the video: what was imagined above the map that it was imagined from.
cv::Mat PictureAboveMap(const cv::Mat& picture, const cv::Mat& map);

}  // namespace evac
