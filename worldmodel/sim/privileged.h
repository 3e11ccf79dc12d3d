#pragma once

#include "core/types.h"
#include "worldmodel/sim/mujoco_handles.h"

namespace evac::sim {

/// The true state of one moment, for the oracle alone: `gripper` (the site between the pads), `finger_left`,
/// `finger_right`, the same with `left_` before it of a left arm, `table`, every free body and what is linked to one,
/// sorted by name; normal forces summed per pair of bodies, a < b, sorted, where the links of a thing count as its free
/// body. Forces at the numerical zero (below 1e-6 N) are left out. The world's own body is called `floor`.
PrivilegedFrame ReadPrivileged(const mjModel& model, const mjData& data);

}  // namespace evac::sim
