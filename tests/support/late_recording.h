#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

#include "core/recording_writer.h"
#include "tests/support/synthetic_recording.h"

namespace evac {

/// Five steps of two arms that are one step behind what they are told, seen by a head camera.
/// @param says_told  whether it says where they were told to be
inline void WriteLateRecording(const TreePlace& place, bool says_told = true) {
  const auto arms_at = [](int step) {
    ArmState left, right;
    left.base_from_gripper = Eigen::Translation3d(0.4 + 0.01 * step, 0.2, 0.3);
    right.base_from_gripper = Eigen::Translation3d(0.4 + 0.01 * step, -0.2, 0.3);
    left.closure = right.closure = 0.25 * step;
    return Arms{left, right};
  };
  RecordedEpisode recorded;
  recorded.cameras = {{"head", 48, 32, 40, 40, 24, 16, Mount::kBase, SyntheticClip::MountFromCamera()}};
  for (int step = 0; step < 5; ++step) {
    recorded.arms.push_back(arms_at(std::max(0, step - 1)));
    if (says_told) recorded.told.push_back(arms_at(step));
    recorded.pictures.push_back({cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(40 + step))});
  }
  WriteRecording(place, recorded, {.scale = 1});
}

}  // namespace evac
