#include "policies/messages.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "core/error.h"
#include "core/geometry.h"

namespace evac {
namespace {

void CheckFinite(std::span<const double> values, const std::string& where, const char* field) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i]))
      throw InvalidInput("{}: {}[{}] is {}, wanted a finite number", where, field, i, values[i]);
  }
}

Eigen::Isometry3d PoseFromWire(const double (&position_m)[3], const double (&xyzw)[4], const std::string& where) {
  CheckFinite(position_m, where, "position_m");
  CheckFinite(xyzw, where, "orientation_xyzw");
  const Eigen::Vector4d quaternion(xyzw[0], xyzw[1], xyzw[2], xyzw[3]);
  if (std::abs(quaternion.norm() - 1) > 1e-3) {
    throw InvalidInput("{}: orientation_xyzw has norm {:.6g}, wanted 1 within 0.001", where, quaternion.norm());
  }
  return FromXyzQuat(Eigen::Vector3d(position_m[0], position_m[1], position_m[2]), quaternion);
}

void PoseToWire(const Eigen::Isometry3d& pose, double (&position_m)[3], double (&xyzw)[4]) {
  const Eigen::Quaterniond rotation(pose.linear());
  Eigen::Map<Eigen::Vector3d>(position_m, 3) = pose.translation();
  Eigen::Map<Eigen::Vector4d>(xyzw, 4) = rotation.coeffs();  // Eigen keeps x, y, z, w
}

}  // namespace

arm_state_t ToWire(const ArmState& arm) {
  arm_state_t wire;
  PoseToWire(arm.base_from_gripper, wire.position_m, wire.orientation_xyzw);
  wire.closure = arm.closure;
  return wire;
}

std::vector<arm_state_t> ToWire(const Arms& arms) {
  std::vector<arm_state_t> wire;
  for (const ArmState& arm : arms) wire.push_back(ToWire(arm));
  return wire;
}

camera_t ToWire(const Camera& camera) {
  camera_t wire;
  wire.name = camera.name;
  wire.width_px = camera.width_px;
  wire.height_px = camera.height_px;
  wire.fx_px = camera.fx_px;
  wire.fy_px = camera.fy_px;
  wire.cx_px = camera.cx_px;
  wire.cy_px = camera.cy_px;
  wire.mount = static_cast<std::int8_t>(camera.mount);
  PoseToWire(camera.mount_from_camera, wire.mount_from_camera_position_m, wire.mount_from_camera_orientation_xyzw);
  return wire;
}

spec_t ToWire(const PolicySpec& spec) {
  spec_t wire;
  wire.num_arms = static_cast<int>(spec.arms.size());
  wire.num_cameras = static_cast<int>(spec.cameras.size());
  wire.num_needs = static_cast<int>(spec.needs.size());
  wire.name = spec.name;
  wire.checkpoint = spec.checkpoint;
  wire.action_space = spec.action_space;
  wire.frame = spec.frame;
  wire.quaternion_order = spec.quaternion_order;
  wire.image_format = spec.image_format;
  wire.gripper_open = spec.gripper_open;
  wire.gripper_closed = spec.gripper_closed;
  wire.period_s = spec.period_s;
  wire.chunk_size = spec.chunk_size;
  wire.arms = spec.arms;
  for (const CameraNeed& camera : spec.cameras) {
    camera_need_t need;
    need.name = camera.name;
    need.width_px = camera.width_px;
    need.height_px = camera.height_px;
    wire.cameras.push_back(need);
  }
  wire.needs.assign(spec.needs.begin(), spec.needs.end());
  return wire;
}

ArmState FromWire(const arm_state_t& arm, const std::string& where) {
  const ArmState state{PoseFromWire(arm.position_m, arm.orientation_xyzw, where), arm.closure};
  CheckFinite({&arm.closure, 1}, where, "closure");
  return state;
}

Camera FromWire(const camera_t& wire) {
  const std::string where = fmt::format("camera {}", wire.name);
  const double pinhole[] = {wire.fx_px, wire.fy_px, wire.cx_px, wire.cy_px};
  CheckFinite(pinhole, where, "fx fy cx cy");
  if (wire.width_px < 1 || wire.height_px < 1 || wire.fx_px <= 0 || wire.fy_px <= 0) {
    throw InvalidInput("{}: size {}x{}, fx_px {}, fy_px {}, wanted all above 0", where, wire.width_px, wire.height_px,
                       wire.fx_px, wire.fy_px);
  }
  if (wire.mount < camera_t::BASE || wire.mount > camera_t::RIGHT_GRIPPER) {
    throw InvalidInput("{}: mount is {}, wanted 0 (base), 1 (left gripper) or 2 (right gripper)", where, wire.mount);
  }
  return {.name = wire.name,
          .width_px = wire.width_px,
          .height_px = wire.height_px,
          .fx_px = wire.fx_px,
          .fy_px = wire.fy_px,
          .cx_px = wire.cx_px,
          .cy_px = wire.cy_px,
          .mount = static_cast<Mount>(wire.mount),
          .mount_from_camera =
              PoseFromWire(wire.mount_from_camera_position_m, wire.mount_from_camera_orientation_xyzw, where)};
}

PolicySpec FromWire(const spec_t& wire) {
  const double numbers[] = {wire.gripper_open, wire.gripper_closed, wire.period_s};
  CheckFinite(numbers, "declaration of " + wire.name, "gripper_open gripper_closed period_s");
  PolicySpec spec{.name = wire.name,
                  .checkpoint = wire.checkpoint,
                  .action_space = wire.action_space,
                  .frame = wire.frame,
                  .quaternion_order = wire.quaternion_order,
                  .image_format = wire.image_format,
                  .gripper_open = wire.gripper_open,
                  .gripper_closed = wire.gripper_closed,
                  .arms = wire.arms,
                  .period_s = wire.period_s,
                  .chunk_size = wire.chunk_size,
                  .cameras = {},
                  .needs = {}};
  for (const camera_need_t& camera : wire.cameras)
    spec.cameras.push_back({camera.name, camera.width_px, camera.height_px});
  spec.needs.insert(wire.needs.begin(), wire.needs.end());
  return spec;
}

ActionChunk FromWire(const chunk_t& wire, const std::vector<std::string>& arms) {
  if (wire.num_targets < 1) throw InvalidInput("the chunk has {} targets, wanted at least 1", wire.num_targets);
  if (wire.num_arms != static_cast<int>(arms.size())) {
    throw InvalidInput("the chunk's targets have {} arms, wanted {} ({})", wire.num_arms, arms.size(),
                       fmt::join(arms, ", "));
  }
  ActionChunk chunk{.targets = {}, .ends_recording = wire.ends_recording != 0};
  for (int k = 0; k < wire.num_targets; ++k) {
    Arms target;
    for (std::size_t i = 0; i < arms.size(); ++i) {
      target.push_back(
          FromWire(wire.targets[k][i], fmt::format("target {} of {}, {} arm", k, wire.num_targets, arms[i])));
    }
    chunk.targets.push_back(std::move(target));
  }
  return chunk;
}

void PutTask(const Task& task, episode_start_t& start) {
  start.num_arms = static_cast<int>(task.arms.size());
  start.num_cameras = static_cast<int>(task.cameras.size());
  start.task_id = task.id;
  start.instruction = task.instruction;
  start.period_s = task.period_s;
  Eigen::Map<Eigen::Vector3d>(start.workspace_min_m, 3) = task.workspace_m.min();
  Eigen::Map<Eigen::Vector3d>(start.workspace_max_m, 3) = task.workspace_m.max();
  start.arms = task.arms;
  start.cameras.clear();
  for (const Camera& camera : task.cameras) start.cameras.push_back(ToWire(camera));
}

Task TaskOf(const episode_start_t& start) {
  const std::string where = "start of task " + start.task_id;
  CheckFinite({&start.period_s, 1}, where, "period_s");
  CheckFinite(start.workspace_min_m, where, "workspace_min_m");
  CheckFinite(start.workspace_max_m, where, "workspace_max_m");
  if (start.num_arms < 1 || start.num_arms > 2) throw InvalidInput("{}: {} arms, wanted 1 or 2", where, start.num_arms);
  Task task;
  task.id = start.task_id;
  task.instruction = start.instruction;
  task.arms = start.arms;
  task.period_s = start.period_s;
  task.workspace_m =
      Eigen::AlignedBox3d(Eigen::Vector3d(start.workspace_min_m), Eigen::Vector3d(start.workspace_max_m));
  for (const camera_t& camera : start.cameras) task.cameras.push_back(FromWire(camera));
  return task;
}

}  // namespace evac
