#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/scene_page.h"

namespace evac::sim {

/// Changes colours, light and clutter of `model` and the free bodies' places in `model.qpos0`: a function of `seed`
/// alone, the same in every profile. @throws InvalidInput if the page names a body or material that the scene has not.
void ApplyInitialState(mjModel& model, const ScenePage& page, std::uint64_t seed);

/// Where ApplyInitialState has put a free body, base frame. @throws InvalidInput if there is no such body.
Eigen::Isometry3d InitialPose(const mjModel& model, const std::string& body);

/// Changes friction, masses, gains, grip force and light of `model` to those of the profile.
void ApplyProfile(mjModel& model, const Profile& profile);

}  // namespace evac::sim
