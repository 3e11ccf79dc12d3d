#pragma once

#include <mujoco/mujoco.h>

namespace evac::sim {

/// MuJoCo 2.2.2's box-box collision now and then reports, beside the right contacts, one that cannot be: decimetres
/// deep, or at a point outside the boxes. Its force throws things off the table. This is that function without such
/// contacts (docs/decisions). It has the signature of mjfCollision; `UseSoundBoxContacts` puts it into MuJoCo's table.
int SoundBoxContacts(const mjModel* model, const mjData* data, mjContact* contacts, int geom1, int geom2,
                     mjtNum margin);

/// Process-wide; call before the first physics step, any number of times.
void UseSoundBoxContacts();

/// Whether two boxes that overlap can touch like this: not deeper than their thinner halves together (and 5 mm), and at
/// a point within 5 mm of both. `geom1`, `geom2` are the boxes' numbers.
bool IsPlausible(const mjModel& model, const mjData& data, const mjContact& contact, int geom1, int geom2);

}  // namespace evac::sim
