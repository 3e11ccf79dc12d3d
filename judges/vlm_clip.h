#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

struct VlmClipOptions {
  int frames = 16;      ///< first, last and uniform between, by time
  int tail_frames = 4;  ///< more of the last quarter, where most tasks are decided
  int long_side_px = 448;
  int jpeg_quality = 80;  ///< 0 … 100
};

/// One frame as a model is shown it: the main view alone, its time and number burnt in.
struct VlmFrame {
  int number = 0;  ///< in the video, from 0
  double time_s = 0;
  int width_px = 0, height_px = 0;
  std::string jpeg{};
  std::string Caption() const;  ///< "t=12.4s (frame 124)"
};

/// Which of `count` frames are shown, ascending, none twice. @throws InvalidInput unless count and frames are positive.
std::vector<int> PickFrames(int count, const VlmClipOptions& options);

/// The frames of an episode's video. The video shows the task's views side by side; the first is the main one.
/// @throws Error naming the file if it cannot be read.
std::vector<VlmFrame> ReadVlmFrames(const std::filesystem::path& video, const Task& task,
                                    const VlmClipOptions& options);

/// What the images cost a model of 28-pixel patches, as most are.
long EstimatedTokens(const std::vector<VlmFrame>& frames);

}  // namespace evac
