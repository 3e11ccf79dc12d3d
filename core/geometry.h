#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "core/types.h"

namespace evac {

/// Where the camera is now: its mount's pose times mount_from_camera, so a moving wrist camera needs no other code.
/// `left_gripper` is the first of two `arms`, `right_gripper` the last: a robot with one arm has the right.
/// @param arms  not empty unless the camera is mounted on the base.
/// @throws InvalidInput naming a camera on the left gripper of a robot that has none: the right hand would carry it.
Eigen::Isometry3d BaseFromCamera(const Camera& camera, const Arms& arms);

/// Pixel (u right, v down; the centre of the first pixel is .5, .5) of a point, or nothing if it is not in front.
std::optional<Eigen::Vector2d> Project(const Camera& camera, const Eigen::Vector3d& point_in_camera_m);

/// Unit direction, in the camera's frame, of the ray through a pixel.
Eigen::Vector3d Ray(const Camera& camera, const Eigen::Vector2d& pixel);

/// The same camera with its image scaled to another size (x and y on their own).
Camera Resized(const Camera& camera, int width_px, int height_px);

/// From translation and quaternion in x, y, z, w order; normalised here.
Eigen::Isometry3d FromXyzQuat(const Eigen::Vector3d& xyz_m, const Eigen::Vector4d& quat_xyzw);

/// Angle of the rotation between the two orientations, radians in [0, pi].
double RotationBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b);

/// How far a camera may be from what a policy was trained with, or is told, and still be the same: a share of its focal
/// length (and of a side of the picture), metres and radians of where it stands on its mount.
inline constexpr double kSameFocal = 0.05, kSameMount_m = 0.03, kSameMount_rad = 0.09;

/// What differs in mount, focal lengths (in picture sides: sizes may differ) and place on the mount by more than these,
/// as the end of "camera head …"; empty: nothing. @param where  the known one is so: "in training"
std::string CalibrationDifference(const Camera& known, const Camera& asked, const std::string& where);

}  // namespace evac
