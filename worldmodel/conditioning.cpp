#include "worldmodel/conditioning.h"

#include <algorithm>

#include "core/error.h"
#include "core/geometry.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/nn/hand_turns.h"

namespace evac {
namespace {

constexpr double kClosedGripper = 120;  // AgiBot's raw reading

Eigen::Matrix3f Intrinsics(const Camera& camera) {
  Eigen::Matrix3d k;
  k << camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1;
  return k.cast<float>();
}

std::vector<DrawnGripper> DrawnArms(const Arms& arms) {
  const BothGrippers grippers = GrippersOf(arms);
  std::vector<DrawnGripper> drawn;
  if (arms.size() == 2) drawn.push_back(Drawn(Side::kLeft, grippers[0]));
  drawn.push_back(Drawn(Side::kRight, grippers[1]));
  return drawn;
}

std::vector<RayMap> Rays(const Arms& arms, std::span<const Camera> cameras, const nn::ModelConfig& config) {
  const double latent = 1.0 / static_cast<double>(config.vae.Stride());
  std::vector<RayMap> rays;
  for (const Camera& camera : cameras) {
    rays.push_back(MakeRayMap(ScaledIntrinsics(Intrinsics(camera), latent, latent),
                              BaseFromCamera(camera, arms).matrix().cast<float>(),
                              static_cast<int>(config.LatentHeight()), static_cast<int>(config.LatentWidth())));
  }
  return rays;
}

/// What every frame since the oldest memory was told says of those that the network is told of.
std::vector<float> TurnsOf(const ImaginedScene& scene, const std::vector<std::size_t>& memory,
                           std::span<const Arms> chunk) {
  const std::size_t oldest = memory.front(), known = scene.frames.size() - oldest;
  std::vector<float> rows;
  const auto add = [&](const Arms& arms) { std::ranges::copy(ActionRow(arms), std::back_inserter(rows)); };
  for (std::size_t frame = oldest; frame < scene.frames.size(); ++frame) add(scene.frames[frame].arms);
  std::ranges::for_each(chunk, add);
  std::vector<std::size_t> frames;
  for (const std::size_t frame : memory) frames.push_back(frame - oldest);
  for (std::size_t k = 0; k < chunk.size(); ++k) frames.push_back(known + k);
  return nn::HandTurns(rows, frames);
}

}  // namespace

Arms SeenArms(const Arms& before, const Arms& now, double lag_frames) {
  if (lag_frames == 0) return now;
  Arms seen = now;
  for (std::size_t arm = 0; arm < now.size(); ++arm) {
    const Eigen::Isometry3d &old = before.at(arm).base_from_gripper, &told = now[arm].base_from_gripper;
    Eigen::Isometry3d& pose = seen[arm].base_from_gripper;
    pose.linear() = Eigen::Quaterniond(told.linear()).slerp(lag_frames, Eigen::Quaterniond(old.linear())).matrix();
    pose.translation() = (1 - lag_frames) * told.translation() + lag_frames * old.translation();
    seen[arm].closure = (1 - lag_frames) * now[arm].closure + lag_frames * before[arm].closure;
  }
  return seen;
}

std::vector<cv::Mat> DrawPoseMaps(const Arms& arms, std::span<const Camera> cameras, const PoseMapOptions& options) {
  const std::vector<DrawnGripper> drawn = DrawnArms(arms);
  std::vector<cv::Mat> maps;
  for (const Camera& camera : cameras) {
    const Eigen::Matrix4f camera_from_base = BaseFromCamera(camera, arms).inverse().matrix().cast<float>();
    const PoseMapView view{camera_from_base, Intrinsics(camera), camera.width_px, camera.height_px};
    maps.push_back(DrawPoseMap(drawn, view, options));
  }
  return maps;
}

std::vector<float> ActionRow(const Arms& arms) {
  std::vector<float> row;
  if (arms.size() == 1) row = {0, 0, 0, 0, 0, 0, 1, 0};
  for (const ArmState& arm : arms) {
    const Eigen::Vector3d& xyz_m = arm.base_from_gripper.translation();
    const Eigen::Quaterniond turn(arm.base_from_gripper.linear());
    for (const double value : {xyz_m.x(), xyz_m.y(), xyz_m.z(), turn.x(), turn.y(), turn.z(), turn.w(),
                               kClosedGripper * arm.closure})
      row.push_back(static_cast<float>(value));
  }
  return row;
}

ChunkConditioning Condition(const ImaginedScene& scene, std::vector<std::size_t> memory, std::span<const Arms> targets,
                            const nn::ModelConfig& config, const ConditioningOptions& options) {
  const auto chunk = static_cast<std::size_t>(config.chunk);
  if (targets.empty() || targets.size() > chunk)
    throw InternalError("{} targets in a chunk, wanted 1 … {}", targets.size(), chunk);
  ChunkConditioning conditioning;
  const auto add = [&](const Arms& told, const Arms& seen) {
    const std::vector<float> row = ActionRow(told);
    conditioning.arms.insert(conditioning.arms.end(), row.begin(), row.end());
    conditioning.rays.push_back(Rays(seen, scene.cameras, config));
  };
  const double lag_frames = options.pose_map.lag_frames;
  for (const std::size_t frame : memory) {
    const Arms& told = scene.frames.at(frame).arms;
    add(told, SeenArms(frame == 0 ? told : scene.frames[frame - 1].arms, told, lag_frames));
  }
  std::vector<Arms> told(targets.begin(), targets.end());
  told.resize(chunk, targets.back());
  const Arms* before = &scene.frames.back().arms;
  for (const Arms& arms : told) {
    const ActionDelta delta = DeltaBetween(GrippersOf(*before), GrippersOf(arms));
    conditioning.deltas.push_back(Normalised(delta, options.statistics, options.stride));
    const Arms seen = SeenArms(*before, arms, lag_frames);
    conditioning.pose_maps.push_back(DrawPoseMaps(seen, scene.cameras, options.pose_map));
    add(arms, seen);
    before = &arms;
  }
  conditioning.turns = TurnsOf(scene, memory, told);
  conditioning.memory = std::move(memory);
  conditioning.count = targets.size();
  return conditioning;
}

}  // namespace evac
