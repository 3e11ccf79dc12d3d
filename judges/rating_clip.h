#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/types.h"

/// How a clip is shown: every clip of a study goes through the same hands, so that nothing but what happens in it can
/// tell where it came from.
namespace evac {

struct ViewPlace {
  std::string name;
  int x_px = 0, y_px = 0, width_px = 0, height_px = 0;
};

/// Where the views of a task stand in the picture: the first camera large at the left, the others in a column beside
/// it.
struct ClipLayout {
  int width_px = 0, height_px = 0;
  std::vector<ViewPlace> views;
};
/// @param height_px  of the first view, even. All sides are even.
ClipLayout LayoutOf(const std::vector<Camera>& cameras, int height_px);

/// As the browser needs it: JSON [{name, x, y, width, height}], shares of the whole picture of a study, in which the
/// layout stands in the middle.
std::string ViewsJson(const ClipLayout& layout, int width_px, int height_px);

struct ClipFormat {
  int width_px = 0, height_px = 0;  ///< of the picture, the same for all clips of a study
  double period_s = 0.1;            ///< of the file; a source of another period is sampled by time
  int crf = 23;
};

/// What pictures that no world model drew are put through before they are shown: the world model's own codec, because
/// its softness would give the imagined ones away.
struct ClipRoundTrip {
  std::string codec_sha256 = {};                             ///< empty: pictures are shown as they are
  std::function<cv::Mat(const cv::Mat& picture)> show = {};  ///< RGB of a camera's size → the same size
};

/// Encodes one episode's video (views side by side, as `evac run` leaves it) for raters. @returns the number of frames.
/// @throws Error naming the file if it is damaged, or its width is not its cameras'.
int EncodeClip(const std::filesystem::path& source, const Task& task, const ClipLayout& layout,
               const ClipFormat& format, const ClipRoundTrip& round_trip, const std::filesystem::path& target);

/// Writes a file again as `padded`, `bytes` long with an mp4 box that players skip, so that its length tells nothing.
/// @throws InternalError if it is longer already.
void PadClip(const std::filesystem::path& file, std::uintmax_t bytes, const std::filesystem::path& padded);

}  // namespace evac
