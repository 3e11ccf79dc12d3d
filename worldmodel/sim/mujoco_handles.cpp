#include "worldmodel/sim/mujoco_handles.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <mutex>

#include "core/error.h"
#include "worldmodel/sim/box_contacts.h"

namespace evac::sim {

ModelPtr LoadModel(const std::filesystem::path& path) {
  static std::mutex compiler;  // MuJoCo's is not thread-safe
  const std::lock_guard lock(compiler);
  std::array<char, 1000> message{};
  ModelPtr model(mj_loadXML(path.c_str(), nullptr, message.data(), static_cast<int>(message.size())));
  if (!model) throw InvalidInput("{}: MuJoCo cannot read this scene: {}", path.string(), message.data());
  return model;
}

ModelPtr CopyModel(const mjModel& model) {
  ModelPtr copy(mj_copyModel(nullptr, &model));
  if (!copy) throw InternalError("MuJoCo could not copy a model of {} bodies: out of memory", model.nbody);
  return copy;
}

DataPtr MakeData(const mjModel& model) {
  DataPtr data(mj_makeData(&model));
  if (!data) throw InternalError("MuJoCo could not make data for {} bodies: out of memory", model.nbody);
  return data;
}

int IdOf(const mjModel& model, mjtObj kind, const std::string& name) {
  const int id = mj_name2id(&model, kind, name.c_str());
  if (id < 0) throw InvalidInput("scene {}: there is no {} named '{}'", model.names, mju_type2Str(kind), name);
  return id;
}

std::string NameOf(const mjModel& model, mjtObj kind, int id) {
  const char* name = mj_id2name(&model, kind, id);
  return name ? name : "";
}

std::string NamePrefix(const std::string& arm) { return arm == "left" ? "left_" : ""; }

bool HasArm(const mjModel& model, const std::string& arm) {
  return mj_name2id(&model, mjOBJ_SITE, (NamePrefix(arm) + "gripper").c_str()) >= 0;
}

bool IsFree(const mjModel& model, int body) {
  return model.body_jntnum[body] == 1 && model.jnt_type[model.body_jntadr[body]] == mjJNT_FREE;
}

bool IsOfThing(const mjModel& model, int body) { return IsFree(model, model.body_rootid[body]); }

Eigen::Isometry3d PoseOf(const mjtNum* position, const mjtNum* rotation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation);
  pose.translation() = Eigen::Map<const Eigen::Vector3d>(position);
  return pose;
}

void PrepareMujoco() {
  static const bool kIsPrepared = [] {  // once, however many threads come here first
    UseSoundBoxContacts();
    mju_user_warning = [](const char*) {};
    mju_user_error = [](const char* message) {  // may not return and may not throw through C
      std::fprintf(stderr, "MuJoCo: %s\n", message);
      std::_Exit(static_cast<int>(ExitCode::kInternal));
    };
    return true;
  }();
  static_cast<void>(kIsPrepared);
}

}  // namespace evac::sim
