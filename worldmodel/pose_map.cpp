#include "worldmodel/pose_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace evac {
namespace {

constexpr double kTurn = 0.5236;        // radians about the tool axis
constexpr float kAxisLength_m = 0.1F;
constexpr float kClosedGripper = 120.0F;
constexpr float kNear_m = 1e-3F;
constexpr int kBackground = 50;
constexpr int kColours = 256;

// ColorBrewer's nine-class Greens and Reds, between which the colours are interpolated.
constexpr std::uint32_t kAnchors[2][9] = {
    {0xf7fcf5, 0xe5f5e0, 0xc7e9c0, 0xa1d99b, 0x74c476, 0x41ab5d, 0x238b45, 0x006d2c, 0x00441b},
    {0xfff5f0, 0xfee0d2, 0xfcbba1, 0xfc9272, 0xfb6a4a, 0xef3b2c, 0xcb181d, 0xa50f15, 0x67000d}};
constexpr double kDarkestRedBlue = 0.05098039215686274;  // as matplotlib writes 13 / 255: a bit less
const cv::Scalar kAxisColours[2][3] = {{{0, 0, 255}, {255, 255, 0}, {0, 255, 255}},
                                       {{255, 0, 255}, {255, 0, 0}, {0, 255, 0}}};
const cv::Scalar kDropColours[2] = {{0, 160, 255}, {255, 160, 0}};

/// The pose the released model's picture shows, in the frame `to`.
Eigen::Matrix4f FromTool(const DrawnGripper& gripper, const Eigen::Matrix4f& to_from_base, float tool_length_m) {
  const float i = gripper.quat_xyzw[0], j = gripper.quat_xyzw[1], k = gripper.quat_xyzw[2], r = gripper.quat_xyzw[3];
  const float s = 2.0F / (r * r + i * i + j * j + k * k);
  Eigen::Matrix4f pose = Eigen::Matrix4f::Identity();
  pose.topLeftCorner<3, 3>() << 1 - s * (j * j + k * k), s * (i * j - k * r), s * (i * k + j * r),  //
      s * (i * j + k * r), 1 - s * (i * i + k * k), s * (j * k - i * r),                            //
      s * (i * k - j * r), s * (j * k + i * r), 1 - s * (i * i + j * j);
  pose.topRightCorner<3, 1>() = gripper.xyz_m;
  Eigen::Matrix4f tool = Eigen::Matrix4f::Identity();
  tool(2, 3) = tool_length_m;
  return Eigen::Matrix4f(Eigen::Matrix4f(to_from_base * pose) * tool);
}

/// Towards zero, as a cast does; what no integer holds becomes the lowest, as x86 casts it.
std::int64_t Truncated(float value) {
  constexpr float kLimit = 9.2233720368547758e18F;
  if (!(value > -kLimit && value < kLimit)) return std::numeric_limits<std::int64_t>::min();
  return static_cast<std::int64_t>(value);
}

/// Coordinates that the rasteriser takes: it clips what is out of the picture, but only within 32 bits.
int Bounded(std::int64_t pixel) {
  constexpr std::int64_t kFar = 1 << 30;
  return static_cast<int>(std::clamp(pixel, -kFar, kFar));
}

struct Projected {
  std::int64_t u = 0, v = 0;
};

Projected Project(const Eigen::Vector3f& point, const Eigen::Matrix3f& intrinsics) {
  const Eigen::Vector3f p = intrinsics * point;
  return {Truncated(p[0] / point[2]), Truncated(p[1] / point[2])};
}

/// The point of the line from `from` (in front) to `to` that is just in front of the camera, or `to`.
Eigen::Vector3f InFront(const Eigen::Vector3f& from, const Eigen::Vector3f& to) {
  if (to[2] >= kNear_m) return to;
  const float part = (from[2] - kNear_m) / (from[2] - to[2]);
  return from + part * (to - from);
}

struct Placed {
  const DrawnGripper* gripper;
  Eigen::Vector3f origin, ends[3];
  Projected at;
};

bool IsInside(const Projected& at, const PoseMapView& view) {
  return at.u >= 0 && at.u < view.width_px && at.v >= 0 && at.v < view.height_px;
}

std::vector<Placed> Visible(std::span<const DrawnGripper> grippers, const PoseMapView& view,
                            const PoseMapOptions& options) {
  std::vector<Placed> visible;
  for (const DrawnGripper& gripper : grippers) {
    const Eigen::Matrix4f camera_from_tool = FromTool(gripper, view.camera_from_base, options.tool_length_m);
    const auto point = [&](float x, float y, float z) {
      return Eigen::Vector3f((camera_from_tool * Eigen::Vector4f(x, y, z, 1)).head<3>());
    };
    Placed placed{&gripper, point(0, 0, 0), {}, {}};
    if (!options.draw_behind_camera && !(placed.origin[2] >= kNear_m)) continue;
    placed.at = Project(placed.origin, view.intrinsics);
    if (!IsInside(placed.at, view)) continue;
    const Eigen::Vector3f ends[3] = {point(kAxisLength_m, 0, 0), point(0, kAxisLength_m, 0),
                                     point(0, 0, kAxisLength_m)};
    for (int axis = 0; axis < 3; ++axis)
      placed.ends[axis] = options.draw_behind_camera ? ends[axis] : InFront(placed.origin, ends[axis]);
    visible.push_back(placed);
  }
  return visible;
}

/// Straight down from the tool to a height, with a mark where it ends.
void DrawDropLine(const Placed& placed, const PoseMapView& view, const PoseMapOptions& options, cv::Mat& map) {
  const Eigen::Vector3f tool = FromTool(*placed.gripper, Eigen::Matrix4f::Identity(), options.tool_length_m).topRightCorner<3, 1>();
  const Eigen::Vector4f foot(tool.x(), tool.y(), static_cast<float>(*options.drop_line_m), 1);
  const Eigen::Vector3f end = (view.camera_from_base * foot).head<3>();
  const Projected shown = Project(InFront(placed.origin, end), view.intrinsics);
  const cv::Scalar& colour = kDropColours[static_cast<int>(placed.gripper->side)];
  const cv::Point from(static_cast<int>(placed.at.u), static_cast<int>(placed.at.v));
  const cv::Point to(Bounded(shown.u), Bounded(shown.v));
  cv::line(map, from, to, colour, options.thickness_px, cv::LINE_8);
  if (end[2] >= kNear_m) cv::circle(map, to, options.thickness_px, colour, cv::FILLED);
}

}  // namespace

DrawnGripper Drawn(Side side, const GripperPose& pose) {
  const double turn = side == Side::kLeft ? -kTurn : kTurn;
  const Eigen::Quaterniond turned =
      pose.base_from_gripper * Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
  return {side, pose.xyz_m.cast<float>(), turned.coeffs().cast<float>(),
          static_cast<float>(pose.closure * static_cast<double>(kClosedGripper))};
}

PoseMapOptions PoseMapOptions::ForHeight(int height_px) {
  nn::PoseMapConfig config;
  config.scaled = true;
  const nn::PoseMapSizes sizes = config.Sizes(height_px);
  return {sizes.radius_px, sizes.thickness_px, false};
}

PoseMapOptions PoseMapOptions::Of(const nn::ModelConfig& config) {
  PoseMapOptions options = config.pose_map.scaled ? ForHeight(static_cast<int>(config.image_height_px)) : PoseMapOptions();
  options.drop_line_m = config.pose_map.drop_line_m;
  options.tool_length_m = static_cast<float>(config.pose_map.tool_length_m);
  options.lag_frames = config.pose_map.lag_frames;
  return options;
}

std::array<std::uint8_t, 3> ClosureColour(Side side, float closure) {
  if (std::isnan(closure)) return {0, 0, 0};
  const float scaled = closure * kColours;
  const int index = scaled < 0 ? 0 : scaled >= kColours ? kColours - 1 : static_cast<int>(scaled);
  // As matplotlib 3.6 fills its table, to the last bit: anchors at k / 8 of 255, colours at index times 1 / 255 of 255.
  const double at = (kColours - 1) * (index * (1.0 / (kColours - 1)));
  int anchor = 1;
  while (anchor < 8 && at > anchor / 8.0 * (kColours - 1)) ++anchor;
  const double before = (anchor - 1) / 8.0 * (kColours - 1), after = anchor / 8.0 * (kColours - 1);
  const double part = (at - before) / (after - before);
  std::array<std::uint8_t, 3> colour{};
  for (int channel = 0; channel < 3; ++channel) {
    const auto value = [&](int i) {
      if (side == Side::kRight && i == 8 && channel == 2) return kDarkestRedBlue;
      return static_cast<double>(kAnchors[static_cast<int>(side)][i] >> (16 - 8 * channel) & 0xff) / 255;
    };
    const double mixed =
        index + 1 == kColours ? value(8) : part * (value(anchor) - value(anchor - 1)) + value(anchor - 1);
    colour[static_cast<std::size_t>(channel)] = static_cast<std::uint8_t>(mixed * 255);
  }
  return colour;
}

cv::Mat DrawPoseMap(std::span<const DrawnGripper> grippers, const PoseMapView& view, const PoseMapOptions& options) {
  cv::Mat map(view.height_px, view.width_px, CV_8UC3, cv::Scalar::all(kBackground));
  const std::vector<Placed> visible = Visible(grippers, view, options);
  for (const Placed& placed : visible) {
    const auto colour = ClosureColour(placed.gripper->side, placed.gripper->gripper / kClosedGripper);
    const cv::Point centre(static_cast<int>(placed.at.u), static_cast<int>(placed.at.v));
    cv::circle(map, centre, options.radius_px, cv::Scalar(colour[0], colour[1], colour[2]), cv::FILLED);
  }
  for (const Placed& placed : visible) {
    if (options.drop_line_m) DrawDropLine(placed, view, options, map);
  }
  for (const Placed& placed : visible) {
    const cv::Point from(static_cast<int>(placed.at.u), static_cast<int>(placed.at.v));
    for (int axis = 0; axis < 3; ++axis) {
      const Projected end = Project(placed.ends[axis], view.intrinsics);
      const cv::Scalar& colour = kAxisColours[static_cast<int>(placed.gripper->side)][axis];
      cv::line(map, from, {Bounded(end.u), Bounded(end.v)}, colour, options.thickness_px, cv::LINE_8);
    }
  }
  return map;
}

}  // namespace evac
