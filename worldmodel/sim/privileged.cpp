#include "worldmodel/sim/privileged.h"

#include <algorithm>
#include <map>
#include <utility>

namespace evac::sim {
namespace {

bool IsReported(const mjModel& model, int body) {
  const std::string name = NameOf(model, mjOBJ_BODY, body);
  return IsOfThing(model, body) || name == "table" || name.ends_with("finger_left") || name.ends_with("finger_right");
}

/// What a geom belongs to, as forces are summed: a thing of several linked bodies is one.
std::string OwnerOfGeom(const mjModel& model, int geom) {
  const int body = model.geom_bodyid[geom];
  if (body == 0) return "floor";
  return NameOf(model, mjOBJ_BODY, IsOfThing(model, body) ? model.body_rootid[body] : body);
}

std::map<std::pair<std::string, std::string>, double> NormalForces(const mjModel& model, const mjData& data) {
  std::map<std::pair<std::string, std::string>, double> forces_n;
  for (int i = 0; i < data.ncon; ++i) {
    std::pair bodies(OwnerOfGeom(model, data.contact[i].geom1), OwnerOfGeom(model, data.contact[i].geom2));
    if (bodies.first == bodies.second) continue;
    if (bodies.second < bodies.first) std::swap(bodies.first, bodies.second);
    mjtNum force_n[6];
    mj_contactForce(&model, &data, i, force_n);  // the first is along the contact's normal
    forces_n[bodies] += force_n[0];
  }
  return forces_n;
}

}  // namespace

PrivilegedFrame ReadPrivileged(const mjModel& model, const mjData& data) {
  PrivilegedFrame frame;
  for (const char* arm : {"left", "right"}) {
    if (!HasArm(model, arm)) continue;
    const std::string name = NamePrefix(arm) + "gripper";
    const int site = IdOf(model, mjOBJ_SITE, name);
    frame.bodies.push_back({name, PoseOf(data.site_xpos + 3 * site, data.site_xmat + 9 * site)});
  }
  for (int body = 1; body < model.nbody; ++body) {
    if (!IsReported(model, body)) continue;
    frame.bodies.push_back({NameOf(model, mjOBJ_BODY, body), PoseOf(data.xpos + 3 * body, data.xmat + 9 * body)});
  }
  std::sort(frame.bodies.begin(), frame.bodies.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  for (const auto& [bodies, force_n] : NormalForces(model, data)) {
    if (force_n > 1e-6) frame.contacts.push_back({bodies.first, bodies.second, force_n});
  }
  return frame;
}

}  // namespace evac::sim
