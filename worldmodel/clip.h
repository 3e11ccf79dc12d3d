#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "core/collection.h"
#include "core/recording.h"
#include "core/seed.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/pose_map.h"

namespace evac {

/// A part of a picture, in whole pixels.
struct Crop {
  int x_px = 0, y_px = 0, width_px = 0, height_px = 0;
};

/// Begins within the first eighth of either side and keeps seven eighths of it or more: as the reference
/// (docs/evac_quirks.md) crops what it trains on.
Crop RandomCrop(const cv::Size& picture_px, SplitMix64& random);

/// The camera whose picture is that part of `camera`'s, resized.
Camera Cropped(const Camera& camera, const Crop& crop, const cv::Size& picture_px);

/// Frames of one recording as a network is trained on them (docs/formats/shards.md says what each array holds).
struct Clip {
  std::int64_t recording = 0;  ///< `clip_id`
  std::int32_t task = 0;
  std::int8_t outcome = -1;
  Crop crop;
  std::size_t length = 0, views = 0;
  std::vector<std::uint8_t> frames, maps;  ///< [T, V, H, W, 3]
  std::vector<float> actions, deltas;      ///< [T, 16], [T, 14]
  std::vector<float> c2w, k, object_px;    ///< [T, V, 4, 4], [T, V, 3, 3], [T, V, 2]
  std::vector<std::uint8_t> contact;       ///< [T]
};

struct ClipOptions {
  cv::Size picture_px;  ///< of the clip
  ActionStatistics statistics;
  double delta_frames = 3;  ///< frames of 30 Hz that one step spans
  PoseMapOptions pose_map;
};

/// One recording, all of it in memory.
struct ClipSource {
  std::vector<Arms> arms;                      ///< [T]: told where that is known and wanted, else measured
  std::vector<Camera> cameras;                 ///< V, of the pictures' sizes
  std::vector<std::vector<cv::Mat>> pictures;  ///< [T][V]
  EpisodeTruth truth;                          ///< in pixels of the pictures; NaN and 0 where nothing is known
};

/// Decodes the recording's pictures, and puts truth into their pixels.
/// @param truth  of the recording's cameras in their order, in pixels of the video, or null
/// @throws Error of kind short_video or broken_video.
ClipSource ReadClipSource(const Recording& recording, const EpisodeTruth* truth);

/// The same crop of all frames; maps drawn for it. Pictures are resized as when imagining: bilinear with antialiasing.
/// Number, task and outcome are left to the caller.
/// @param crop  in pixels of view 0's picture
Clip MakeClip(const ClipSource& source, const Crop& crop, const ClipOptions& options);

}  // namespace evac
