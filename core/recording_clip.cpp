#include <cmath>

#include "core/error.h"
#include "core/file.h"
#include "core/recording_parts.h"
#include "core/video.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kAgibotPeriod_s = 1.0 / 30;
constexpr double kRateTolerance = 0.02;  // time stamps are rounded to a video's time base

constexpr double kMoreFrames = 1.2;      // of a step each: a video may go on a little longer than the arms' track

/// What one walk through a video tells.
struct VideoFacts {
  cv::Mat first;
  std::size_t frames = 0;
  double period_s = 0;  ///< mean; 0 if there is one frame
};

/// @param count  false: stop after two frames; the file says the mean rate, where it does not they do.
VideoFacts LookThrough(const fs::path& path, bool count) {
  VideoReader video(path);
  VideoFacts facts{video.Next(), 0, 0};
  if (facts.first.empty()) throw InvalidInput("{}: the video has no frame", path.string());
  const double begin_s = video.time_s();
  double end_s = begin_s;
  facts.frames = 1;
  while ((count || facts.frames < 2) && !video.Next().empty()) {
    end_s = video.time_s();
    ++facts.frames;
  }
  if (facts.frames > 1) facts.period_s = (end_s - begin_s) / static_cast<double>(facts.frames - 1);
  if (!count && facts.frames > 1 && video.mean_period_s() > 0) facts.period_s = video.mean_period_s();
  return facts;
}

/// About a whole number of frames per second is meant exactly.
double Snapped(double period_s) {
  const double rate_hz = std::round(1 / period_s);
  return rate_hz > 0 && std::abs(period_s * rate_hz - 1) < kRateTolerance ? 1 / rate_hz : period_s;
}

fs::path VideoOf(const ClipFolders& folders, const std::string& camera) {
  return folders.images / (camera + "_color.mp4");
}
fs::path IntrinsicsOf(const ClipFolders& folders, const std::string& camera) {
  return folders.pages / (camera + "_intrinsic_params.json");
}
fs::path ExtrinsicsOf(const ClipFolders& folders, const std::string& camera) {
  return folders.pages / (camera + "_extrinsic_params_aligned.json");
}

/// The cameras asked for, or all that have a video; head always.
std::vector<std::string> ChooseCameras(const ClipFolders& folders, const RecordingOptions& options) {
  if (!options.cameras.empty()) return options.cameras;
  std::vector<std::string> names = CamerasOfClip(folders);
  for (const std::string& name : names) {
    if (name == "head" || IsFileThere(VideoOf(folders, name))) continue;
    throw InvalidInput("{}: there is a page for camera {}, but no video {}", folders.pages.string(), name,
                       VideoOf(folders, name).string())
        .Called("missing_camera");
  }
  return names;
}

/// What reading the cameras needs to know of the rest.
struct Context {
  const ClipFolders& folders;
  const RecordingOptions& options;
  const std::vector<Arms>& arms;  ///< all recorded steps
};

Camera ReadCamera(const Context& context, const std::string& name, const cv::Mat& first) {
  const fs::path intrinsics = IntrinsicsOf(context.folders, name);
  const fs::path extrinsics = ExtrinsicsOf(context.folders, name);
  Camera camera = ParseIntrinsics(ReadFile(intrinsics), intrinsics.string());
  camera.name = name;
  camera.width_px = first.cols;
  camera.height_px = first.rows;
  camera.mount = MountOf(name, 2);  // an absent left arm is dropped with its mount, later
  CheckPinhole(camera, intrinsics.string());
  const std::vector<Eigen::Isometry3d> poses = ParseExtrinsics(ReadFile(extrinsics), extrinsics.string());
  camera.mount_from_camera = FixedMount({camera.mount, poses, context.arms}, context.options, extrinsics.string());
  return camera;
}

/// @throws InvalidInput if a video is too short or far too long for the steps, or its rate differs from that of the videos before it.
void CheckVideo(const VideoFacts& facts, const fs::path& path, const Context& context, double period_s) {
  if (context.options.count_video_frames && facts.frames < context.arms.size()) {
    throw InvalidInput("{}: {} frames, wanted one for each of the {} steps of {}", path.string(), facts.frames,
                       context.arms.size(), context.folders.proprio.string())
        .Called("short_video");
  }
  const std::size_t steps = context.arms.size();
  if (context.options.count_video_frames && steps >= kBeginning && static_cast<double>(facts.frames) > kMoreFrames * static_cast<double>(steps)) {
    throw InvalidInput("{}: {} frames for the {} steps of {}, wanted one for each: arms recorded at another rate than the video?",
                       path.string(), facts.frames, context.arms.size(), context.folders.proprio.string())
        .Called("other_rate");
  }
  if (period_s > 0 && std::abs(facts.period_s / period_s - 1) > kRateTolerance) {
    throw InvalidInput("{}: {:.2f} frames per second, wanted {:.2f} as the video before it", path.string(),
                       1 / facts.period_s, 1 / period_s)
        .Called("other_rate");
  }
}

/// Adds one camera that has a video. @returns the video's period, s, or 0 if it has one frame.
double AddVideoCamera(const Context& context, const std::string& name, double period_s, Recording& recording) {
  const fs::path path = VideoOf(context.folders, name);
  if (!IsFileThere(path))
    throw InvalidInput("{}: missing: camera {} has no video", path.string(), name).Called("missing_camera");
  const VideoFacts facts =
      Calling("broken_video", [&] { return LookThrough(path, context.options.count_video_frames); });
  CheckVideo(facts, path, context, period_s);
  recording.videos.push_back(path);
  recording.first_images.push_back(facts.first);
  recording.cameras.push_back(Calling("broken_page", [&] { return ReadCamera(context, name, facts.first); }));
  return facts.period_s;
}

/// A clip without videos: its first frame is all there is to see.
void AddStillCamera(const Context& context, const std::vector<std::string>& names, Recording& recording) {
  const fs::path frame = context.folders.images / "frame.png";
  if (names != std::vector<std::string>{"head"} || !IsFileThere(frame)) {
    // The last of those without: the first one has none either, but its first frame could do.
    std::string missing = names.front();
    for (const std::string& name : names) missing = IsFileThere(VideoOf(context.folders, name)) ? missing : name;
    throw InvalidInput("{}: missing: camera {} has no video", VideoOf(context.folders, missing).string(), missing)
        .Called("missing_camera");
  }
  recording.first_images = {ReadPng(frame)};
  recording.cameras = {Calling("broken_page", [&] { return ReadCamera(context, "head", recording.first_images[0]); })};
}

}  // namespace

std::vector<std::string> CamerasOfClip(const ClipFolders& folders) {
  const auto is_there = [](const fs::path& path) {  // or cannot be known not to be: who reads it says why
    std::error_code error;
    return fs::exists(path, error) || error;
  };
  const bool has_videos = is_there(VideoOf(folders, "head"));
  std::vector<std::string> names = {"head"};
  for (const std::string name : {"hand_left", "hand_right"}) {
    const bool has_page = has_videos && is_there(IntrinsicsOf(folders, name));
    if (has_page || is_there(VideoOf(folders, name))) names.push_back(name);
  }
  return names;
}

Mount MountOf(const std::string& camera, std::size_t arms) {
  if (camera == "hand_left") return arms == 2 ? Mount::kLeftGripper : Mount::kBase;
  return camera == "hand_right" ? Mount::kRightGripper : Mount::kBase;
}

Recording ReadClipLayout(const ClipFolders& folders, const RecordingOptions& options) {
  std::vector<Arms> arms = Calling("broken_track", [&] { return ReadProprio(folders.proprio); });
  std::vector<Arms> told;
  if (options.read_told) told = ReadToldOf(folders.proprio, arms.size());
  const Context context{folders, options, arms};
  const std::vector<std::string> names = ChooseCameras(folders, options);
  Recording recording;
  recording.id = folders.id;
  double video_period_s = 0;
  if (IsFileThere(VideoOf(folders, names.front()))) {
    for (const std::string& name : names) video_period_s = AddVideoCamera(context, name, video_period_s, recording);
  } else {
    AddStillCamera(context, names, recording);
  }
  const double found_period_s = video_period_s > 0 ? Snapped(video_period_s) : kAgibotPeriod_s;
  recording.files = recording.videos.empty() ? std::vector{folders.images / "frame.png"} : recording.videos;
  recording.files.push_back(folders.proprio);
  for (const std::string& name : names) {
    recording.files.push_back(IntrinsicsOf(folders, name));
    recording.files.push_back(ExtrinsicsOf(folders, name));
  }
  recording.says_period = options.recorded_period_s > 0 || video_period_s > 0;
  recording.period_s = (options.recorded_period_s > 0 ? options.recorded_period_s : found_period_s) * options.every_nth;
  recording.arms = EveryNth(std::move(arms), options.every_nth);
  recording.told = EveryNth(std::move(told), options.every_nth);
  recording.arm_names = {"left", "right"};
  DropAbsentLeftArm(recording, folders.proprio.string());
  recording.source = fmt::format("{}: AgiBot World layout, {} cameras{}", folders.images.string(), names.size(),
                                 recording.videos.empty() ? ", first frame" : "");
  return recording;
}

}  // namespace evac
