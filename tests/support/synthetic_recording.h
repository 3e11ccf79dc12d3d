#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "core/recording_parts.h"

namespace evac {

/// A recording in AgiBot World's files that a test makes up and then spoils as it likes. Both grippers move and turn;
/// the wrist cameras sit still on them, the head camera on the base. Frame k of every video is uniformly grey,
/// FrameGrey(k).
struct SyntheticClip {
  explicit SyntheticClip(int steps);

  std::vector<float> grippers;           ///< [T, 2] raw, 0 open … 120 closed
  std::vector<double> positions_m;       ///< [T, 2, 3]
  std::vector<double> quaternions_xyzw;  ///< [T, 2, 4]
  std::vector<std::string> cameras = {"head"};
  int steps;
  int frames;         ///< of each video; at first = steps
  double slip_m = 0;  ///< by how much the cameras have slid on their mounts at the last step

  static constexpr int kWidth_px = 48, kHeight_px = 32;
  static int FrameGrey(int frame) { return 20 + 12 * frame; }
  /// Where the cameras sit on their mounts.
  static Eigen::Isometry3d MountFromCamera();
  Eigen::Isometry3d BaseFromGripper(int step, int arm) const;

  /// As recordings of a robot without one say it: at the base's origin, unturned, open.
  void LoseLeftArm();

  void Write(const ClipFolders& folders) const;

 private:
  std::string Extrinsics(const std::string& camera) const;
};

/// All in one folder.
ClipFolders OneFolder(const std::filesystem::path& folder);
/// The tree under `root`, episode 648642 of task 327. @returns its places; `images` is …/videos.
ClipFolders TreeUnder(const std::filesystem::path& root);

/// Writes a text or bytes file of a test, its folders made.
void WriteText(const std::filesystem::path& path, const std::string& text);

}  // namespace evac
