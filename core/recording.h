#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// How a recording is read; the defaults read all of it.
struct RecordingOptions {
  int every_nth = 1;             ///< keep every nth recorded step: the period grows by as much (30 Hz and 3: 0.1 s)
  double recorded_period_s = 0;  ///< between recorded steps; 0: the layout's (example .1 s, else the video's or 1/30 s)
  std::vector<std::string> cameras = {};  ///< which, by name and in this order; empty: all that are there, head first
  double camera_tolerance_m = 0.02;  ///< how far a camera may move against its mount and still count as fixed to it …
  double camera_tolerance_rad = 0.05;  ///< … and how far it may turn
  bool count_video_frames = true;  ///< false: believe that the videos are long enough (a policy that needs no image)
  bool read_told = false;  ///< also read where the arms were told to be, where the file has it (`Recording::told`)
};

/// What one robot did, from one folder (docs/formats/recording.md): the arms at every step, and the cameras' images, at
/// least the first one of each.
struct Recording {
  std::string id;      ///< the folder's name, or <task>-<episode> in an AgiBot World tree; safe as a path
  std::string source;  ///< one sentence: folder, layout, steps, period
  double period_s = 0;
  std::vector<std::string> arm_names;  ///< {left, right}; {right} of a robot that has no left arm
  std::vector<Arms> arms;              ///< [T], T >= 1, one per period: arms[0] is the start, arms[1 …] what followed
  std::vector<Arms> told;  ///< [T], where they were told to be by then (told[0] is the start), or empty: not recorded
  std::vector<Camera> cameras;         ///< sizes are those of the images
  std::vector<cv::Mat> first_images;   ///< CV_8UC3 RGB, in the order of `cameras`
  std::vector<std::filesystem::path> videos;  ///< in the order of `cameras`, or empty: there is only the first frame
  int every_nth = 1;                          ///< step k is frame k * every_nth of a video
  int shrink = 1;  ///< pixels of a video to one of `first_images` and of what RecordedFrames shows, in either direction
  std::vector<std::filesystem::path> files;   ///< all that were read
  bool says_period = true;  ///< false: no video says how far apart steps are, and `period_s` is the layout's
};

/// Reads a recording in one of three layouts, recognised by the files that are there:
///   example    frame.png, action.npy, extrinsics.npy, intrinsics.npy; 10 Hz (every third step of 30 Hz)
///   clip       head_color.mp4 (or frame.png), {camera}_intrinsic_params.json, {camera}_extrinsic_params_aligned.json,
///              proprio_stats.h5, all in one folder; also hand_left_color.mp4 and hand_right_color.mp4 with their pages
///   tree       the same files in AgiBot World's tree; `folder` is ROOT/observations/<task>/<episode>
/// Gripper units become closures (raw 0 open … 120 closed), quaternions rotations.
/// @throws InvalidInput naming file, field, what was found and what was wanted: a file missing or broken, a video
/// shorter than
///   the arms' track, values that are not finite, quaternions that are not unit, positions more than 5 m from the base,
///   an arm that lies at the base's origin at every step (but for an absent left one, unturned and open), distorted
///   intrinsics, a camera that moves against its mount. `Error::kind` is one word for the reason
///   (docs/formats/recording.md).
Recording ReadRecording(const std::filesystem::path& folder, const RecordingOptions& options = {});

/// Where a recording's camera of this name is mounted, as its files do not say: `hand_right` on the right gripper,
/// `hand_left` on the left one, but on the base where the recording has one arm; any other on the base.
Mount MountOf(const std::string& camera, std::size_t arms);

/// The cameras that a recording has by the files that are there, the head first: those that ReadRecording reads, or
/// refuses, where it is asked for none. Nothing is opened.
std::vector<std::string> CamerasIn(const std::filesystem::path& folder);

/// What ReadRecording calls the recording in a folder, whatever is in it.
std::string RecordingId(const std::filesystem::path& folder);

/// What a model is told of the arms, [T]: where they were at step 0, then where they were told to be, or were if that was
/// not recorded.
std::vector<Arms> ToldTrack(const Recording& recording);

/// The folders that hold a recording's files: `folder` alone, or those of an episode in an AgiBot World tree that
/// exist (of its videos, its cameras' pages, its arms).
std::vector<std::filesystem::path> FoldersOf(const std::filesystem::path& folder);

/// Whether a file of this name in a recording's folders is one that ReadRecording may read, whatever cameras it is asked
/// for; all others (depth, tactile) are not looked at.
bool IsReadOfRecording(const std::string& name);

/// A recording of the head camera alone, in files of any name.
struct RecordingFiles {
  std::filesystem::path frame;       ///< PNG: the first image
  std::filesystem::path actions;     ///< .npy as in the example layout (0.1 s a step), or .h5 as in a clip (1/30 s)
  std::filesystem::path extrinsics;  ///< .npy, or .json as in a clip
  std::filesystem::path intrinsics;  ///< .npy, or .json as in a clip
};

/// @throws InvalidInput as ReadRecording; also for a file of another ending.
Recording ReadRecordingFiles(const RecordingFiles& files, const RecordingOptions& options = {});

/// The same recording in steps `period_s` apart: every nth of its own, of the arms as of the videos. What is within 2 %
/// of a whole number of them is meant exactly: the period is `period_s` then.
/// @throws InvalidInput with both periods (kind `other_rate`) for any other.
Recording Thinned(Recording recording, double period_s);

/// The same of a recording that episodes of steps `period_s` apart begin from. Fewer steps than 16, of which no video
/// says how far apart they are, are a beginning and no more: where they cannot be thinned they are taken to be that far
/// apart.
/// @throws InvalidInput as Thinned for any other.
Recording BegunFrom(Recording recording, double period_s);

/// The same recording in smaller images, each pixel the mean of `shrink` x `shrink`, with cameras of their size: of
/// videos that were drawn larger than their pictures (RecordingVideo::scale) those pictures.
Recording Shrunk(Recording recording, int shrink);

/// One walk through a recording's images, front to back. Each has its own decoders: any number walk at once.
class RecordedFrames {
 public:
  explicit RecordedFrames(const Recording& recording);
  ~RecordedFrames();
  RecordedFrames(RecordedFrames&&) noexcept;
  RecordedFrames& operator=(RecordedFrames&&) noexcept;

  /// The images of the next step, in the order of `cameras`; first those of step 0. After the last step, and where
  /// there are no videos, the last ones again. The Mats are shared: do not write into them.
  /// @throws Error if a video ends early or is broken.
  const std::vector<cv::Mat>& Next();

 private:
  struct Walk;
  std::unique_ptr<Walk> walk_;
};

/// The task "do what was recorded": id, arms, cameras and period of the recording, the stop rule switched off, enough
/// chunks for all steps whatever their length, and a workspace `margin_m` wider on all sides than where the grippers
/// went.
Task TaskFromRecording(const Recording& recording, double margin_m = 0.5);

/// Its first frame as the initial scene of imagined episodes.
InitialScene InitialSceneOf(const Recording& recording);

}  // namespace evac
