#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/types.h"
#include "core/video.h"

namespace evac {

/// Where one episode lies in an AgiBot World tree (docs/formats/recording.md).
struct TreePlace {
  std::filesystem::path root;
  std::string task, episode;

  /// ROOT/observations/<task>/<episode>: what ReadRecording takes.
  std::filesystem::path Folder() const { return root / "observations" / task / episode; }
};

/// One episode as it is to be written.
struct RecordedEpisode {
  double period_s = 0.1;
  std::vector<Arms> arms;  ///< [T] measured, {right} or {left, right}
  std::vector<Arms> told;  ///< [T] where they were told to be by then; empty: not known
  std::vector<Camera> cameras;
  std::vector<std::vector<cv::Mat>> pictures;  ///< [T][V] CV_8UC3 RGB, of the cameras' sizes
};

/// How the pictures become videos. H.264 in yuv420p halves the colour's resolution, which small pictures do not bear:
/// drawn twice as large (`scale` 2, each pixel 2x2) they come back, as a mean over 2x2, 4 dB closer (docs/collect.md).
struct RecordingVideo {
  int crf = 10;
  int scale = 2;
  std::string preset = "superfast";  ///< of x264: pictures with a sensor's noise gain nothing from a slower one
};

/// Before hours go into what nobody can read back.
/// @param arms   how many the robot has
/// @param where  for the message: a task page, a folder
/// @throws InvalidInput naming the camera: one that is not mounted where readers take its name to be (MountOf), or no
///   `head`, which every recording has.
void CheckReadableCameras(const std::vector<Camera>& cameras, std::size_t arms, const std::string& where);

/// Writes the episode's videos, camera pages (in pixels of the videos, a pose per step) and proprio_stats.h5; each file
/// whole or not at all. The same episode gives the same bytes. A wrist camera's pose is that of the measured arm.
/// Thread-safe.
/// @throws InternalError if tracks and pictures disagree in length; InvalidInput as CheckReadableCameras; Error if the
///   disk refuses.
void WriteRecording(const TreePlace& place, const RecordedEpisode& episode, const RecordingVideo& video);

}  // namespace evac
