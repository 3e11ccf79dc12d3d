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

std::vector<cv::Mat> ReadClip(const std::filesystem::path& path, int scale) {
  std::vector<cv::Mat> frames = ReadAllFrames(path);
  for (cv::Mat& frame : frames) frame = AtPictureSize(frame, scale);
  return frames;
}

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

void DriftMeter::Add(const ClipPair& clips) {
  const std::vector<cv::Mat> real = ReadClip(clips.real, clips.scale), model = ReadClip(clips.model, clips.scale);
  const std::size_t frames = std::min(real.size(), model.size());
  const Camera& head = clips.task->cameras.front();
  const cv::Rect head_px(0, 0, head.width_px, head.height_px);
  const std::vector<cv::Rect> views = ViewsOf(*clips.task);
  const std::size_t chunks = (frames > 0 ? frames - 1 : 0) / static_cast<std::size_t>(chunk_);
  if (sums_.size() < chunks) sums_.resize(chunks);
  for (std::size_t t = 1; t <= chunks * static_cast<std::size_t>(chunk_); ++t) {
    Sums& sums = sums_[(t - 1) / static_cast<std::size_t>(chunk_)];
    const cv::Mat moved = Moved(real[t], real[0]);
    sums.clips += (t - 1) % static_cast<std::size_t>(chunk_) == 0;
    for (const cv::Rect& view : views) {
      sums.error += SquaredError(real[t](view), model[t](view), {});
      sums.values += 3.0 * view.area();
    }
    sums.moving_error += SquaredError(real[t], model[t], moved);
    sums.copy_error += SquaredError(real[t], real[0], moved);
    sums.moving_values += 3.0 * cv::countNonZero(moved);
    if (t - 1 >= clips.commands.size()) continue;
    for (const ArmState& arm : clips.commands[t - 1]) {
      const auto patch = GripperPatch(clips, clips.commands[t - 1], arm, real[t](head_px));
      if (!patch) continue;
      ++sums.grippers_in_sight;
      if (const auto px = GripperError(*patch, real[t](head_px), model[t](head_px))) {
        sums.gripper_px += *px;
        ++sums.grippers;
      }
    }
  }
  if (frames < 2) return;
  const auto truly = FindObject(*clips.task, real[frames - 1](head_px));
  if (!truly) return;
  const auto seen = FindObject(*clips.task, model[frames - 1](head_px));
  object_px_.push_back(seen ? std::hypot(seen->x - truly->x, seen->y - truly->y)
                            : std::hypot(head.width_px, head.height_px));
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
