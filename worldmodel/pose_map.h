#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <opencv2/core.hpp>
#include <span>

#include "worldmodel/action_delta.h"
#include "worldmodel/nn/model_config.h"

/// The grippers' poses drawn into a view, as the network was trained to read them (EVAC, Sec. 3.2).
namespace evac {

/// A gripper as it is drawn: turned 30 degrees about its tool axis, the left clockwise. In float, as in training.
struct DrawnGripper {
  Side side = Side::kRight;
  Eigen::Vector3f xyz_m = Eigen::Vector3f::Zero();
  Eigen::Vector4f quat_xyzw{0, 0, 0, 1};
  float gripper = 0;  ///< 0 open … 120 closed: AgiBot's unit
};

DrawnGripper Drawn(Side side, const GripperPose& pose);

/// Where the picture is taken from.
struct PoseMapView {
  Eigen::Matrix4f camera_from_base = Eigen::Matrix4f::Identity();
  Eigen::Matrix3f intrinsics = Eigen::Matrix3f::Identity();  ///< pixels of the picture to draw
  int width_px = 512;
  int height_px = 320;
};

struct PoseMapOptions {
  int radius_px = 50;    ///< of the disc that shows the closure; absolute, whatever the picture's size, as in training
  int thickness_px = 8;  ///< of the axes
  /// Quirk draw_behind_camera: the reference knows no depth and draws mirrored what is behind the camera.
  bool draw_behind_camera = false;
  float tool_length_m = 0.23F;  ///< from the gripper's pose to where its fingers meet: what is drawn
  /// Height in metres, base frame, to which a line is drawn straight down from each gripper. Not in the paper.
  std::optional<double> drop_line_m = std::nullopt;
  double lag_frames = 0;  ///< told arms are seen so late (conditioning.h, SeenArms); maps and moving cameras are of them

  /// The same in parts of a picture of this height: for other sizes than the published 320.
  static PoseMapOptions ForHeight(int height_px);
  /// As the network's page says for its picture.
  static PoseMapOptions Of(const nn::ModelConfig& config);
};

/// Discs first (left, right), then the lines to the table if wanted, then the axes x, y, z of both. A gripper whose origin is out of the picture is not drawn;
/// one behind the camera neither; an axis whose end is behind it ends at the picture's near side.
/// @returns [height_px, width_px, 3] RGB, 50 where nothing is drawn
cv::Mat DrawPoseMap(std::span<const DrawnGripper> grippers, const PoseMapView& view, const PoseMapOptions& options);

/// RGB of a closure, as drawn: matplotlib's Greens (left) or Reds (right), light open, dark closed. Outside [0, 1]: the
/// ends; not a number: black.
std::array<std::uint8_t, 3> ClosureColour(Side side, float closure);

}  // namespace evac
