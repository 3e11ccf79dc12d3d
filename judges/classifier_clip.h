#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"

namespace evac {

/// Which pictures of a stored clip are wanted.
struct ClipLook {
  std::vector<Camera> cameras;  ///< the views that stand side by side in the clip, as Task::cameras
  int frames = 8;               ///< evenly spaced, the first and the last among them; one that is too short repeats
  cv::Size picture_px;          ///< each view comes back in this size
  int most_frames = 0;          ///< above 0: a clip of more is refused
};

/// Reads a clip as episodes store them: the task's views side by side, each pixel drawn several times over. Reads the
/// video and nothing else.
/// @returns [V][frames] CV_8UC3 RGB
/// @throws InvalidInput naming the file: it cannot be read to its end, is longer than `most_frames`, or its pictures
/// are not the cameras' (found,
///   wanted).
std::vector<std::vector<cv::Mat>> ReadClip(const std::filesystem::path& video, const ClipLook& look);

/// `count` of 0 … frames - 1, evenly spaced, the first and the last among them. @param frames, count > 0
std::vector<int> EvenlySpaced(int frames, int count);

}  // namespace evac
