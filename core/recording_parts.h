#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <mutex>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/recording.h"
#include "core/types.h"

/// What the layouts of a recording have in common. Only core/recording*.cpp, their tests and fuzzers include this.
namespace evac {

inline constexpr std::size_t kMaxRecordedSteps = 1'000'000;  ///< nine hours at 30 Hz

inline constexpr std::size_t kBeginning = 16;  ///< steps: fewer are where an episode begins, whatever is shown later

inline constexpr double kClosedGripper = 120;  ///< AgiBot's reading of a closed gripper; in `action` it is 1

/// A gripper's pose as AgiBot's files hold it.
/// @param where  "FILE: state/end: step 17, left arm", for messages.
/// @throws InvalidInput if a value is not finite, the position is more than 5 m from the base's origin, or |quaternion|
///   is not 1 within 1e-3.
Eigen::Isometry3d PoseFromRaw(const Eigen::Vector3d& xyz_m, const Eigen::Vector4d& quat_xyzw, const std::string& where);

/// A gripper's closure from its reading, 0 open; readings a little outside are clamped.
/// @param closed  what it reads when closed
/// @throws InvalidInput if it reads outside -1/12 … 7/6 of that (of 120: -10 … 140).
double ClosureFromRaw(double gripper, double closed, const std::string& where);

/// @throws InvalidInput unless finite and a rotation within 1e-3; it comes back orthonormal.
Eigen::Isometry3d RigidOrThrow(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation_m,
                               const std::string& where);

/// @throws InvalidInput unless the focal lengths are positive and the principal point lies within 0.15 … 0.85 of each
///   side (else the intrinsics belong to an image of another size).
void CheckPinhole(const Camera& camera, const std::string& where);

/// An 8-bit RGB image of at most 8192 x 8192 from a PNG file.
cv::Mat ReadPng(const std::filesystem::path& path);

/// `{camera}_intrinsic_params.json`: {"intrinsic": {"fx", "fy", "ppx", "ppy"}} in pixels; a camera of that name,
/// without size and pose.
/// @throws InvalidInput also for distortion: any of k1 … k6, p1, p2, or a list whose name contains "dist" or "coeff",
/// not 0.
Camera ParseIntrinsics(const std::string& json, const std::string& file);

/// `{camera}_extrinsic_params_aligned.json`: a list of {"extrinsic": {"rotation_matrix", "translation_vector"}}, one
/// per step or one for all. base_from_camera, OpenCV axes.
std::vector<Eigen::Isometry3d> ParseExtrinsics(const std::string& json, const std::string& file);

/// `proprio_stats.h5`: state/effector/position [T, 2], state/end/position [T, 2, 3] m, state/end/orientation [T, 2, 4]
/// xyzw; index 0 left, 1 right.
/// @returns [T], left and right arm at every step.
std::vector<Arms> ReadProprio(const std::filesystem::path& path);
/// The same of action/effector/position (0 open … 1 closed), action/end/position and action/end/orientation: where the
/// arms were told to be at each step. @returns nothing if the file has no such groups.
std::vector<Arms> ReadTold(const std::filesystem::path& path);
/// The same beside a track of so many measured steps. @throws Error called broken_track, also where it has other ones.
std::vector<Arms> ReadToldOf(const std::filesystem::path& path, std::size_t steps);
/// HDF5 keeps state of its own, for the whole process: whoever calls it holds this.
std::unique_lock<std::mutex> LockHdf5();
/// A robot without a left arm: it lies at the base's origin, unturned and open, at every step, where no gripper can be.
/// A camera that was mounted on it is mounted on the base.
/// @param file  of the arms, for messages
/// @throws InvalidInput called absent_arm for an arm that lies there otherwise: a left one turned or closed (its
///   quaternion w first, say), and the right one, which every recording has.
void DropAbsentLeftArm(Recording& recording, const std::string& file);

/// The bytes of `proprio_stats.h5`: `arms` as state, `told` (unless empty) as action; a missing left arm at the base's
/// origin. The same arms give the same bytes.
std::string ProprioBytes(const std::vector<Arms>& arms, const std::vector<Arms>& told);

/// The pose of a camera on its mount, from where it was at every step.
struct CameraTrack {
  Mount mount = Mount::kBase;
  const std::vector<Eigen::Isometry3d>&
      base_from_camera;           ///< one per step, or one for all (then the mount is the base)
  const std::vector<Arms>& arms;  ///< [T]
};
/// @returns mount_from_camera at step 0.
/// @throws InvalidInput if it is not the same at all steps within the options' tolerance; names the first step that is
/// off.
Eigen::Isometry3d FixedMount(const CameraTrack& track, const RecordingOptions& options, const std::string& file);

/// Whether there is such a file. @throws Error called unreadable where nobody can know: a folder without rights, a link
/// to itself.
bool IsFileThere(const std::filesystem::path& path);

/// What `read` returns; an Error of it without a kind gets this one.
template <typename Read>
auto Calling(const char* kind, const Read& read) {
  try {
    return read();
  } catch (const Error& error) {
    throw error.kind()[0] == '\0' ? error.Called(kind) : error;
  }
}

/// Every nth of the steps.
std::vector<Arms> EveryNth(std::vector<Arms> arms, int n);

/// The two readers behind ReadRecording.
Recording ReadExampleLayout(const std::filesystem::path& folder, const RecordingOptions& options);
struct ClipFolders {
  std::string id;  ///< the recording's
  std::filesystem::path images, pages;  ///< folders with {camera}_color.mp4 and with {camera}_*.json
  std::filesystem::path proprio;        ///< the h5 file
};
Recording ReadClipLayout(const ClipFolders& folders, const RecordingOptions& options);
/// The head, and the wrist cameras that have a video, or beside a head's video a page.
std::vector<std::string> CamerasOfClip(const ClipFolders& folders);

}  // namespace evac
