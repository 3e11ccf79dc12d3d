#include "core/recording.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/recording_folders.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kRateTolerance = 0.02;  // periods are typed with few digits, time stamps rounded

/// ROOT/observations/<task>/<episode> (or its videos folder) → the places of its parts.
ClipFolders TreeFolders(const fs::path& episode) {
  const fs::path task = episode.parent_path().filename(), number = episode.filename();
  const fs::path root = episode.parent_path().parent_path().parent_path();
  return {fmt::format("{}-{}", task.string(), number.string()), episode / "videos",
          root / "parameters" / task / number / "parameters" / "camera",
          root / "proprio_stats" / task / number / "proprio_stats.h5"};
}

bool IsTreeEpisode(const fs::path& folder) { return folder.parent_path().parent_path().filename() == "observations"; }

void CheckOptions(const RecordingOptions& options) {
  if (options.every_nth < 1) throw InvalidInput("recording: every_nth is {}, wanted 1 or more", options.every_nth);
  const auto twice = [&](const std::string& name) {
    return std::count(options.cameras.begin(), options.cameras.end(), name) > 1;
  };
  if (std::any_of(options.cameras.begin(), options.cameras.end(), twice))
    throw InvalidInput("recording: a camera is named twice");
}

/// Through links, or, where those cannot be followed, as it is.
fs::path Followed(const fs::path& folder) {
  std::error_code error;
  const fs::path absolute = fs::weakly_canonical(folder, error);
  return error ? folder : absolute;
}

bool IsThere(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

/// How many of its steps a period is; 0: no whole number of them.
int StepsIn(double period_s, const Recording& recording) {
  const double steps = period_s / recording.period_s;
  const int whole = static_cast<int>(std::lround(steps));
  return whole >= 1 && std::abs(steps - whole) <= kRateTolerance * whole ? whole : 0;
}

/// The tree's episode that the folder is, or is the videos of; empty: neither, or a folder that holds all itself.
fs::path TreeEpisode(const fs::path& folder) {
  if (IsThere(folder / "action.npy") || IsThere(folder / "proprio_stats.h5")) return {};
  if (IsTreeEpisode(folder)) return folder;
  return folder.filename() == "videos" && IsTreeEpisode(folder.parent_path()) ? folder.parent_path() : fs::path();
}

/// One folder that holds all.
ClipFolders ClipIn(const fs::path& folder) {
  return {folder.filename().string(), folder, folder, folder / "proprio_stats.h5"};
}

Recording ReadLayout(const fs::path& folder, const RecordingOptions& options) {
  if (IsFileThere(folder / "action.npy")) return ReadExampleLayout(folder, options);
  if (IsFileThere(folder / "proprio_stats.h5")) return ReadClipLayout(ClipIn(folder), options);
  if (const fs::path episode = TreeEpisode(folder); !episode.empty())
    return ReadClipLayout(TreeFolders(episode), options);
  if (const fs::path picture = FirstPictureIn(folder); !picture.empty()) {
    throw InvalidInput(
        "{}: found {}, and neither action.npy nor proprio_stats.h5; wanted one of the two: where the arms were",
        folder.string(), picture.filename().string())
        .Called("broken_track");
  }
  throw InvalidInput(
      "{}: no recording; wanted a folder with action.npy, one with proprio_stats.h5, or an episode of an AgiBot World "
      "tree: ROOT/observations/<task>/<episode>",
      folder.string());
}

}  // namespace

Recording ReadRecording(const fs::path& folder, const RecordingOptions& options) {
  CheckOptions(options);
  std::error_code error;
  const fs::path absolute = fs::canonical(folder, error);
  if (error || !fs::is_directory(absolute, error))
    throw InvalidInput("{}: no such folder", folder.string()).Called("unreadable");
  Recording recording = ReadLayout(absolute, options);
  recording.id = RecordingId(absolute);
  recording.every_nth = options.every_nth;
  recording.source += fmt::format(", {} steps of {:.4g} s", recording.arms.size(), recording.period_s);
  return recording;
}

std::vector<std::string> CamerasIn(const fs::path& folder) {
  const fs::path absolute = Followed(folder);
  if (IsThere(absolute / "action.npy")) return {"head"};
  const fs::path episode = TreeEpisode(absolute);
  return CamerasOfClip(episode.empty() ? ClipIn(absolute) : TreeFolders(episode));
}

std::string RecordingId(const fs::path& folder) {
  const fs::path absolute = Followed(folder);
  const fs::path episode = TreeEpisode(absolute);
  return SafeName(episode.empty() ? absolute.filename().string() : TreeFolders(episode).id);
}

std::vector<Arms> ToldTrack(const Recording& recording) {
  if (recording.told.empty()) return recording.arms;
  std::vector<Arms> track = recording.told;
  track.front() = recording.arms.front();
  return track;
}

std::vector<fs::path> FoldersOf(const fs::path& folder) {
  const fs::path absolute = Followed(folder);
  const fs::path episode = TreeEpisode(absolute);
  if (episode.empty()) return {absolute};
  const ClipFolders places = TreeFolders(episode);
  std::vector<fs::path> folders = {episode};
  for (const fs::path& part : {places.pages, places.proprio.parent_path()}) {
    if (std::error_code ignored; fs::is_directory(part, ignored)) folders.push_back(part);
  }
  return folders;
}

bool IsReadOfRecording(const std::string& name) {
  for (const char* whole : {"frame.png", "action.npy", "extrinsics.npy", "intrinsics.npy", "proprio_stats.h5"}) {
    if (name == whole) return true;
  }
  return name.ends_with("_color.mp4") || name.ends_with("_intrinsic_params.json") ||
         name.ends_with("_extrinsic_params_aligned.json");
}

Recording Thinned(Recording recording, double period_s) {
  const int every_nth = StepsIn(period_s, recording);
  if (every_nth == 0)
    throw InvalidInput("{}: wanted steps of {:.4g} s, or of a whole part of it", recording.source, period_s)
        .Called("other_rate");
  recording.period_s = period_s;
  if (every_nth == 1) return recording;
  recording.arms = EveryNth(std::move(recording.arms), every_nth);
  recording.told = EveryNth(std::move(recording.told), every_nth);
  recording.every_nth *= every_nth;
  recording.source += fmt::format(", one in {} kept", every_nth);
  return recording;
}

Recording BegunFrom(Recording recording, double period_s) {
  const bool is_beginning = !recording.says_period && recording.arms.size() < kBeginning;
  if (!is_beginning || StepsIn(period_s, recording) > 0) return Thinned(std::move(recording), period_s);
  recording.period_s = period_s;
  recording.source += fmt::format(", taken to be {:.4g} s apart", period_s);
  return recording;
}

Task TaskFromRecording(const Recording& recording, double margin_m) {
  Task task;
  task.id = recording.id;
  task.instruction = fmt::format("Do what was recorded in {}.", recording.id);
  task.arms = recording.arm_names;
  task.cameras = recording.cameras;
  task.period_s = recording.period_s;
  task.max_chunks = std::max<int>(1, static_cast<int>(recording.arms.size()) - 1);
  task.still.enabled = false;
  task.workspace_m.setEmpty();
  for (const Arms& arms : recording.arms) {
    for (const ArmState& arm : arms) task.workspace_m.extend(arm.base_from_gripper.translation());
  }
  task.workspace_m.min().array() -= margin_m;
  task.workspace_m.max().array() += margin_m;
  task.rubric.version = kNoRubric;
  task.rubric.success = "A recording has no rubric of its own.";
  return task;
}

InitialScene InitialSceneOf(const Recording& recording) {
  return {recording.first_images, recording.arms.front(), recording.cameras};
}

}  // namespace evac
