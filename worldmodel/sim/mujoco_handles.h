#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <string>

/// MuJoCo's C objects, owned; its row-major arrays as Eigen values.
namespace evac::sim {

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, DeleteModel>;
using DataPtr = std::unique_ptr<mjData, DeleteData>;

/// Compiles a scene, one at a time. @throws InvalidInput with MuJoCo's own words.
ModelPtr LoadModel(const std::filesystem::path& path);
ModelPtr CopyModel(const mjModel& model);
DataPtr MakeData(const mjModel& model);

/// The number of a named thing. @throws InvalidInput if the scene has none of that name.
int IdOf(const mjModel& model, mjtObj kind, const std::string& name);
std::string NameOf(const mjModel& model, mjtObj kind, int id);

/// What the names of an arm's parts begin with: nothing for "right", `left_` for "left".
std::string NamePrefix(const std::string& arm);
/// Whether the scene has that arm: a site `gripper` (`left_gripper`).
bool HasArm(const mjModel& model, const std::string& arm);

/// Whether a body has a free joint, and so can be placed and carried.
bool IsFree(const mjModel& model, int body);
/// Whether a body is a thing or part of one: it is free, or linked by joints to a free body (a leaf's wings to its
/// rib).
bool IsOfThing(const mjModel& model, int body);

/// Position and row-major rotation, e.g. data.site_xpos + 3 * id and data.site_xmat + 9 * id.
Eigen::Isometry3d PoseOf(const mjtNum* position, const mjtNum* rotation);

/// Sends MuJoCo's warnings nowhere (each scene reads its own counts) and its fatal errors to stderr and exit code 4;
/// without this it would write files into the working directory and wait for a key. Repairs its box contacts
/// (box_contacts.h). Process-wide; call before the first model, from any
/// thread and as often as you like.
void PrepareMujoco();

}  // namespace evac::sim
