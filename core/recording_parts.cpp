#include "core/recording_parts.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/geometry.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kLowestGripper = -10, kHighestGripper = 140;  // of 120; beyond these it is another unit
constexpr double kFarthest_m = 5;                              // no arm on a base reaches there
constexpr double kUnitTolerance = 1e-3;
constexpr unsigned kMaxSide_px = 8192;
/// Parts of a side: lenses are not off by more, and intrinsics of pictures twice as large or half as large are.
constexpr double kFirstCentral = 0.15, kLastCentral = 0.85;

/// A side of the image out of the PNG's first chunk (big-endian), so that a lying file cannot ask for gigabytes.
unsigned PngSide(const std::string& bytes, std::size_t at) {
  unsigned side = 0;
  for (std::size_t i = at; i < at + 4; ++i) side = side << 8 | static_cast<unsigned char>(bytes[i]);
  return side;
}

}  // namespace

Eigen::Isometry3d PoseFromRaw(const Eigen::Vector3d& xyz_m, const Eigen::Vector4d& quat_xyzw,
                              const std::string& where) {
  if (!xyz_m.allFinite() || !quat_xyzw.allFinite())
    throw InvalidInput("{}: the pose is not finite", where).Called("not_finite");
  if (xyz_m.norm() > kFarthest_m) {
    throw InvalidInput("{}: the gripper is {:.4g} m from the base's origin, wanted at most {}: another unit?", where,
                       xyz_m.norm(), kFarthest_m)
        .Called("position_unit");
  }
  const double length = quat_xyzw.norm();
  if (std::abs(length - 1) > kUnitTolerance) {
    throw InvalidInput("{}: the quaternion has length {:.4f}, wanted 1 within {}", where, length, kUnitTolerance)
        .Called("no_rotation");
  }
  return FromXyzQuat(xyz_m, quat_xyzw);
}

double ClosureFromRaw(double gripper, double closed, const std::string& where) {
  const double of_120 = kClosedGripper / closed * gripper;
  if (!(of_120 >= kLowestGripper && of_120 <= kHighestGripper)) {
    throw InvalidInput("{}: the gripper reads {}, wanted 0 (open) … {} (closed)", where, gripper, closed)
        .Called("gripper_unit");
  }
  return std::clamp(of_120 / kClosedGripper, 0.0, 1.0);
}

Eigen::Isometry3d RigidOrThrow(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation_m,
                               const std::string& where) {
  if (!rotation.allFinite() || !translation_m.allFinite()) throw InvalidInput("{}: the pose is not finite", where).Called("not_finite");
  const double off = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(off < kUnitTolerance && rotation.determinant() > 0)) {
    throw InvalidInput("{}: the rotation matrix is no rotation (R Rᵀ is {:.4f} from the identity, determinant {:.4f})",
                       where, off, rotation.determinant())
        .Called("no_rotation");
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  pose.translation() = translation_m;
  return pose;
}

void CheckPinhole(const Camera& camera, const std::string& where) {
  if (!(camera.fx_px > 0 && camera.fy_px > 0 && std::isfinite(camera.fx_px) && std::isfinite(camera.fy_px))) {
    throw InvalidInput("{}: focal lengths {}, {} px, wanted positive numbers", where, camera.fx_px, camera.fy_px);
  }
  const auto is_central = [](double at_px, int side_px) {
    return at_px >= kFirstCentral * side_px && at_px <= kLastCentral * side_px;
  };
  if (!is_central(camera.cx_px, camera.width_px) || !is_central(camera.cy_px, camera.height_px)) {
    throw InvalidInput(
        "{}: principal point ({:.1f}, {:.1f}) px in an image of {}x{}, wanted one within {} … {} of each side: "
        "intrinsics of another size?",
        where, camera.cx_px, camera.cy_px, camera.width_px, camera.height_px, kFirstCentral, kLastCentral);
  }
}

cv::Mat ReadPng(const fs::path& path) {
  const std::string bytes = ReadFile(path);
  constexpr std::size_t kWidthAt = 16, kHeightAt = 20, kHeaderEnd = 24;
  if (bytes.size() < kHeaderEnd || bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") != 0)
    throw InvalidInput("{}: no PNG file", path.string());
  const unsigned width_px = PngSide(bytes, kWidthAt), height_px = PngSide(bytes, kHeightAt);
  if (width_px == 0 || height_px == 0 || width_px > kMaxSide_px || height_px > kMaxSide_px) {
    throw InvalidInput("{}: {}x{} pixels, wanted 1 … {} each", path.string(), width_px, height_px, kMaxSide_px);
  }
  cv::Mat image;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    image = cv::imdecode(encoded, cv::IMREAD_COLOR);  // BGR
    if (!image.empty()) cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  } catch (const cv::Exception& error) {
    throw InvalidInput("{}: the PNG cannot be decoded: {}", path.string(), error.what());
  }
  if (image.empty()) throw InvalidInput("{}: the PNG cannot be decoded", path.string());
  return image;
}

bool IsFileThere(const fs::path& path) {
  std::error_code error;
  if (fs::exists(path, error)) return true;
  if (error) throw InvalidInput("{}: cannot be looked at: {}", path.string(), error.message()).Called("unreadable");
  return false;
}

Eigen::Isometry3d FixedMount(const CameraTrack& track, const RecordingOptions& options, const std::string& file) {
  const auto& poses = track.base_from_camera;
  const std::size_t steps = track.arms.size();
  if (poses.size() == 1 && track.mount == Mount::kBase) return poses.front();
  if (poses.size() < steps) throw InvalidInput("{}: {} poses, wanted one per step: {}", file, poses.size(), steps);
  const auto mount_from_camera = [&](std::size_t k) -> Eigen::Isometry3d {
    if (track.mount == Mount::kBase) return poses[k];
    const ArmState& arm = track.mount == Mount::kLeftGripper ? track.arms[k].front() : track.arms[k].back();
    return arm.base_from_gripper.inverse() * poses[k];
  };
  const Eigen::Isometry3d first = mount_from_camera(0);
  for (std::size_t k = 1; k < steps; ++k) {
    const Eigen::Isometry3d now = mount_from_camera(k);
    const double moved_m = (now.translation() - first.translation()).norm(), turned_rad = RotationBetween(now, first);
    if (moved_m <= options.camera_tolerance_m && turned_rad <= options.camera_tolerance_rad) continue;
    throw InvalidInput(
        "{}: at step {} the camera is {:.3f} m and {:.3f} rad from where it was at step 0 on its mount ({}); wanted "
        "at most {} m and {} rad: a camera that moves on its mount cannot be described",
        file, k, moved_m, turned_rad, track.mount == Mount::kBase ? "the base" : "the gripper",
        options.camera_tolerance_m, options.camera_tolerance_rad)
        .Called("moving_camera");
  }
  return first;
}

std::vector<Arms> EveryNth(std::vector<Arms> arms, int n) {
  std::vector<Arms> kept;
  for (std::size_t k = 0; k < arms.size(); k += static_cast<std::size_t>(n)) kept.push_back(std::move(arms[k]));
  return kept;
}

}  // namespace evac
