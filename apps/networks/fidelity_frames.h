#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "core/types.h"
#include "reports/fidelity.h"

namespace evac {

/// A real clip and the imagined one of the same actions, as stored.
struct ClipPair {
  const Task* task = nullptr;
  std::filesystem::path real, model;
  std::vector<Arms> commands;  ///< one per frame behind the first
  int scale = 1;               ///< video pixels per picture pixel
  double tool_length_m = 0.23; ///< from the arms' poses to where the fingers meet
};

/// What pictures say of clips, gathered one after the other. No learned part: squared errors, the object's colour, and
/// the gripper's patch found again by normalised correlation.
class DriftMeter {
 public:
  /// @param chunk  K, frames
  explicit DriftMeter(int chunk) : chunk_(chunk) {}

  /// Clips of different length are measured as far as both go; of each, the first frame and the last that was read are
  /// held, and no more.
  /// @throws Error if a video cannot be read: nothing of the two is added then.
  void Add(const ClipPair& clips);

  std::vector<ChunkDrift> Chunks() const;
  const std::vector<double>& object_px() const { return object_px_; }

 private:
  struct Sums {
    std::int64_t clips = 0, frames = 0;
    double error = 0, moving_error = 0, copy_error = 0, gripper_px = 0;
    double values = 0, moving_values = 0;
    std::int64_t grippers = 0, grippers_in_sight = 0;  ///< found, of those that the real picture shows
  };
  /// Frames of the same time, at picture size, and the real clip's first.
  struct Shown {
    cv::Mat first, real, model;
  };

  /// @param t  of the frames, at least 1
  static void AddFrame(const ClipPair& clips, std::size_t t, const Shown& shown, Sums& sums);

  int chunk_;
  std::vector<Sums> sums_;
  std::vector<double> object_px_;
};

/// The middle of the task's object in the head camera's picture, by its colour; nothing if it does not show, or the
/// task is none that `visual_pick` knows.
std::optional<cv::Point2d> FindObject(const Task& task, const cv::Mat& head_rgb);

}  // namespace evac
