#pragma once

#include <optional>
#include <string>

#include "core/types.h"

namespace evac {

/// What is wrong with a chunk, as a sentence with the numbers, or nothing. A valid chunk has 1 … `max_targets` targets, each with
/// the task's number of arms, finite positions inside the task's workspace, rotations that are rotations (|q| within 1e-3
/// of 1 where they came as quaternions, orthonormal here), and closures in [0, 1].
std::optional<std::string> WhatIsWrong(const ActionChunk& chunk, const Task& task, int max_targets);

/// The same for what a world answers: images of the cameras' sizes, finite arms.
std::optional<std::string> WhatIsWrong(const Observation& observation, const Task& task);

/// The same for a step that nobody sees, within a chunk of a world that is not filmed: no images, finite arms.
std::optional<std::string> WhatIsWrongUnseen(const Observation& observation, const Task& task);

}  // namespace evac
