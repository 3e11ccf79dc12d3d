#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>

#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/scene_page.h"

namespace evac::sim {

/// Changes colours, light and clutter of `model` and the free bodies' places in `model.qpos0`: a function of `seed`
/// alone, the same in every profile. @throws InvalidInput if the page names a body or material that the scene has not.
void ApplyInitialState(mjModel& model, const ScenePage& page, std::uint64_t seed);

/// Changes friction, masses, gains, grip force and light of `model` to those of the profile.
void ApplyProfile(mjModel& model, const Profile& profile);

}  // namespace evac::sim
