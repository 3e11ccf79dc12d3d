#include "apps/networks/fidelity_frames.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/geometry.h"
#include "core/video.h"
#include "policies/visual_things.h"

namespace evac {
namespace {

constexpr int kMovedGreyLevels = 24;      ///< a pixel moves where a channel differs by more from the first frame
constexpr double kMinObject_px = 4;       ///< area
constexpr int kPatch_px = 7, kSearch_px = 8;  ///< half sides: of the gripper's patch, of where it is looked for
constexpr double kMinCorrelation = 0.4;
constexpr double kPlain = 0.5;  ///< standard deviation in grey levels, of every channel

cv::Mat AtPictureSize(const cv::Mat& frame, int scale) {
  if (scale == 1) return frame;
  cv::Mat small;
  cv::resize(frame, small, {frame.cols / scale, frame.rows / scale}, 0, 0, cv::INTER_AREA);
  return small;
}

/// A clip's frames at picture size, one after the other: at the video's, a whole clip may take gigabytes.
class Frames {
 public:
  Frames(const std::filesystem::path& path, int scale) : reader_(path), scale_(scale) {}
  /// Empty at the end.
  cv::Mat Next() {
    const cv::Mat frame = reader_.Next();
    return frame.empty() ? frame : AtPictureSize(frame, scale_);
  }
  /// What is broken further on is said all the same.
  void SkipRest() {
    while (reader_.Skip()) {
    }
  }

 private:
  VideoReader reader_;
  int scale_;
};

double SquaredError(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  const double distance = cv::norm(a, b, cv::NORM_L2, mask);
  return distance * distance;
}

/// Where each camera's picture is: views lie side by side, and below lower ones it is black (core/video.h).
std::vector<cv::Rect> ViewsOf(const Task& task) {
  std::vector<cv::Rect> views;
  int x = 0;
  for (const Camera& camera : task.cameras) {
    views.emplace_back(x, 0, camera.width_px, camera.height_px);
    x += camera.width_px;
  }
  return views;
}

cv::Rect HeadOf(const Task& task) { return {0, 0, task.cameras.front().width_px, task.cameras.front().height_px}; }

/// 255 where a channel differs from the first frame.
cv::Mat Moved(const cv::Mat& frame, const cv::Mat& first) {
  cv::Mat difference;
  cv::absdiff(frame, first, difference);
  std::vector<cv::Mat> channels;
  cv::split(difference, channels);
  return cv::max(channels[0], cv::max(channels[1], channels[2])) > kMovedGreyLevels;
}

/// Black or blown out all over: it correlates with anything.
bool IsPlain(const cv::Mat& patch) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(patch, mean, deviation);
  return std::max({deviation[0], deviation[1], deviation[2]}) < kPlain;
}

/// Where an arm's gripper is in the first camera's real picture; nothing if it is out of sight, or too plain to be found.
std::optional<cv::Rect> GripperPatch(const ClipPair& clips, const Arms& arms, const ArmState& arm, const cv::Mat& real) {
  const Camera& camera = clips.task->cameras.front();
  const Eigen::Vector3d tool = arm.base_from_gripper * Eigen::Vector3d(0, 0, clips.tool_length_m);
  const auto at = Project(camera, BaseFromCamera(camera, arms).inverse() * tool);
  if (!at) return std::nullopt;
  const cv::Point centre(static_cast<int>(std::floor(at->x())), static_cast<int>(std::floor(at->y())));
  const cv::Rect patch(centre.x - kPatch_px, centre.y - kPatch_px, 2 * kPatch_px + 1, 2 * kPatch_px + 1);
  const cv::Rect all(0, 0, camera.width_px, camera.height_px);
  return (patch & all) == patch && !IsPlain(real(patch)) ? std::optional(patch) : std::nullopt;
}

/// How far that patch of the real picture lies from there in the imagined one; nothing if it is not there.
std::optional<double> GripperError(const cv::Rect& patch, const cv::Mat& real, const cv::Mat& model) {
  const cv::Rect around = cv::Rect(patch.x - kSearch_px, patch.y - kSearch_px, patch.width + 2 * kSearch_px,
                                   patch.height + 2 * kSearch_px) & cv::Rect({}, model.size());
  cv::Mat score;
  cv::matchTemplate(model(around), real(patch), score, cv::TM_CCOEFF_NORMED);
  double best = 0;
  cv::Point place;
  cv::minMaxLoc(score, nullptr, &best, nullptr, &place);
  if (!(best >= kMinCorrelation)) return std::nullopt;
  const cv::Point moved = place + around.tl() - patch.tl();
  return std::hypot(moved.x, moved.y);
}

Number Psnr(double error, double values) {
  if (values == 0) return Undefined{"nothing moved"};
  return -10 * std::log10(std::max(error / values, 1e-3) / (255.0 * 255.0));
}

}  // namespace

std::optional<cv::Point2d> FindObject(const Task& task, const cv::Mat& head_rgb) try {
  const std::vector<Blob> blobs = FindBlobs(head_rgb, KnowledgeOf(task.id).thing.colour, kMinObject_px);
  if (blobs.empty()) return std::nullopt;
  return cv::Point2d(blobs.front().centroid_px.x(), blobs.front().centroid_px.y());
} catch (const Error&) {
  return std::nullopt;
}

void DriftMeter::AddFrame(const ClipPair& clips, std::size_t t, const Shown& shown, Sums& sums) {
  const cv::Mat moved = Moved(shown.real, shown.first);
  for (const cv::Rect& view : ViewsOf(*clips.task)) {
    sums.error += SquaredError(shown.real(view), shown.model(view), {});
    sums.values += 3.0 * view.area();
  }
  sums.moving_error += SquaredError(shown.real, shown.model, moved);
  sums.copy_error += SquaredError(shown.real, shown.first, moved);
  sums.moving_values += 3.0 * cv::countNonZero(moved);
  if (t - 1 >= clips.commands.size()) return;
  const cv::Rect head_px = HeadOf(*clips.task);
  for (const ArmState& arm : clips.commands[t - 1]) {
    const auto patch = GripperPatch(clips, clips.commands[t - 1], arm, shown.real(head_px));
    if (!patch) continue;
    ++sums.grippers_in_sight;
    if (const auto px = GripperError(*patch, shown.real(head_px), shown.model(head_px))) {
      sums.gripper_px += *px;
      ++sums.grippers;
    }
  }
}

void DriftMeter::Add(const ClipPair& clips) {
  Frames real(clips.real, clips.scale), model(clips.model, clips.scale);
  Shown shown;
  shown.first = shown.real = real.Next();
  shown.model = model.Next();
  std::vector<Sums> sums = sums_;  // of clips that cannot be read on nothing is kept
  Sums unfinished;                 // of a chunk that does not become whole nothing is
  const auto whole = static_cast<std::size_t>(chunk_);
  std::size_t frames = 1;
  for (;; ++frames) {
    const cv::Mat next_real = real.Next(), next_model = model.Next();
    if (next_real.empty() || next_model.empty()) break;
    shown.real = next_real;
    shown.model = next_model;
    const std::size_t chunk = (frames - 1) / whole, place = (frames - 1) % whole;
    if (place == 0) unfinished = chunk < sums.size() ? sums[chunk] : Sums();
    AddFrame(clips, frames, shown, unfinished);
    if (place + 1 < whole) continue;
    ++unfinished.clips;
    if (chunk == sums.size()) sums.emplace_back();
    sums[chunk] = unfinished;
  }
  real.SkipRest();
  model.SkipRest();
  sums_ = std::move(sums);
  if (frames < 2) return;
  const cv::Rect head = HeadOf(*clips.task);
  const auto truly = FindObject(*clips.task, shown.real(head));
  if (!truly) return;
  const auto seen = FindObject(*clips.task, shown.model(head));
  object_px_.push_back(seen ? std::hypot(seen->x - truly->x, seen->y - truly->y)
                            : std::hypot(head.width, head.height));
}

std::vector<ChunkDrift> DriftMeter::Chunks() const {
  std::vector<ChunkDrift> chunks;
  for (const Sums& sums : sums_) {
    ChunkDrift chunk;
    chunk.clips = sums.clips;
    if (sums.values > 0) chunk.psnr = Psnr(sums.error, sums.values);
    chunk.psnr_moving = Psnr(sums.moving_error, sums.moving_values);
    chunk.psnr_moving_copy = Psnr(sums.copy_error, sums.moving_values);
    if (sums.grippers > 0) chunk.gripper_px = sums.gripper_px / static_cast<double>(sums.grippers);
    if (sums.grippers_in_sight > 0)
      chunk.gripper_found = static_cast<double>(sums.grippers) / static_cast<double>(sums.grippers_in_sight);
    chunks.push_back(chunk);
  }
  return chunks;
}

}  // namespace evac
