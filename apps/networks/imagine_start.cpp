#include "apps/networks/imagine_start.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "core/hash.h"
#include "core/names.h"

namespace evac {
namespace {

constexpr double kPeriodTolerance = 0.02;  // as of a recording that is thinned (core/recording.h)

void CheckNamed(const ImagineInputs& inputs) {
  const std::pair<const char*, const std::filesystem::path*> files[] = {{"--frame", &inputs.files.frame},
                                                                        {"--actions", &inputs.files.actions},
                                                                        {"--extrinsics", &inputs.files.extrinsics},
                                                                        {"--intrinsics", &inputs.files.intrinsics}};
  for (const auto& [option, file] : files) {
    const bool named = !file->empty(), wanted = inputs.recording.empty();
    if (named && !wanted) throw InvalidInput("{} and --recording exclude each other", option);
    if (named || !wanted) continue;
    throw InvalidInput(
        "{} is missing: wanted --recording DIR, or all of --frame, --actions, --extrinsics and --intrinsics", option);
  }
}

/// As many of those that are there as there are views, the head first: as `evac pack` takes them.
std::vector<std::string> CamerasThere(const std::string& recording, std::size_t views) {
  std::vector<std::string> cameras = CamerasIn(recording);
  if (cameras.size() < views) {
    ReadRecording(recording, {.cameras = cameras, .count_video_frames = false});  // or says what else is wrong with it
    throw InvalidInput("{}: cameras: found {} ({}), wanted {}, one for each view of the network", recording,
                       cameras.size(), Joined(cameras), views);
  }
  cameras.resize(views);
  return cameras;
}

/// Those asked for, or as many as there are views, the head first.
std::vector<std::string> Cameras(const ImagineInputs& inputs, std::size_t views) {
  std::vector<std::string> cameras = inputs.cameras;
  if (cameras.empty() && !inputs.recording.empty()) return CamerasThere(inputs.recording, views);
  if (cameras.empty()) cameras = {"head", "hand_left", "hand_right"};
  if (cameras.size() < views || (!inputs.cameras.empty() && cameras.size() != views))
    throw InvalidInput("--cameras: {} cameras, wanted {}, one for each view of the network", cameras.size(), views);
  cameras.resize(views);
  return cameras;
}

Recording Read(const ImagineInputs& inputs, std::size_t views) {
  const bool wants_told = inputs.arms.empty() ? inputs.read_told : inputs.arms == "told";
  const RecordingOptions options{.cameras = Cameras(inputs, views), .count_video_frames = false, .read_told = wants_told};
  Recording recording = inputs.recording.empty() ? ReadRecordingFiles(inputs.files, options)
                                                 : ReadRecording(inputs.recording, options);
  if (!wants_told || !recording.told.empty()) return recording;
  if (!inputs.arms.empty())
    throw InvalidInput("{}: it does not say where the arms were told to be, as --arms told wants", recording.source);
  fmt::print(stderr,
             "evac: warning: {}: the network learned from where arms were told to be, which is not recorded here: where they were is "
             "taken\n",
             recording.source);
  return recording;
}

void Append(std::string& bytes, double value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof(value)); }

void Append(std::string& bytes, const Eigen::Isometry3d& pose) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) Append(bytes, pose(row, column));
  }
}

void Append(std::string& bytes, const Arms& arms) {
  Append(bytes, static_cast<double>(arms.size()));
  for (const ArmState& arm : arms) {
    Append(bytes, arm.base_from_gripper);
    Append(bytes, arm.closure);
  }
}

}  // namespace

ImagineStart ReadImagineStart(const ImagineInputs& inputs, std::size_t views) {
  CheckNamed(inputs);
  Recording recording = Read(inputs, views);
  const int automatic = std::max(1, static_cast<int>(std::lround(inputs.period_s / recording.period_s)));
  std::vector<Arms> track = ToldTrack(recording);
  ImagineStart start;
  start.stride = inputs.stride > 0 ? inputs.stride : automatic;
  start.source = recording.source;
  start.scene = InitialSceneOf(recording);
  start.arm_names = recording.arm_names;
  for (std::size_t step = 0; step < track.size(); step += static_cast<std::size_t>(start.stride))
    start.arms.push_back(std::move(track[step]));
  if (start.arms.size() < 2) {
    throw InvalidInput("{}: of {} steps every {} leaves nothing to imagine after the first frame", recording.source,
                       track.size(), start.stride);
  }
  start.period_s = recording.period_s * start.stride;
  const bool is_expected = std::abs(start.period_s / inputs.period_s - 1) <= kPeriodTolerance;
  if (is_expected) start.period_s = inputs.period_s;  // as of a recording that is packed
  if (inputs.stride == 0 && !is_expected)
    fmt::print(stderr,
               "evac: warning: {}: its steps are {:.4g} s apart: every {} taken, {:.4g} s apart, where the network expects {:.4g} s\n",
               recording.source, recording.period_s, start.stride, start.period_s, inputs.period_s);
  start.files = std::move(recording.files);
  return start;
}

std::string HashOf(const InitialScene& scene) {
  std::string bytes;
  for (const cv::Mat& image : scene.images) {
    const cv::Mat rows = image.isContinuous() ? image : image.clone();
    bytes.append(reinterpret_cast<const char*>(rows.data), rows.total() * rows.elemSize());
  }
  for (const Camera& camera : scene.cameras) {
    bytes += camera.name;
    for (const double value :
         {static_cast<double>(camera.width_px), static_cast<double>(camera.height_px), camera.fx_px, camera.fy_px,
          camera.cx_px, camera.cy_px, static_cast<double>(camera.mount)})
      Append(bytes, value);
    Append(bytes, camera.mount_from_camera);
  }
  return Sha256Hex(bytes);
}

std::string HashOf(const std::vector<Arms>& arms) {
  std::string bytes;
  for (const Arms& step : arms) Append(bytes, step);
  return Sha256Hex(bytes);
}

}  // namespace evac
