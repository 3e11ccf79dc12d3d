#pragma once

#include <filesystem>
#include <string>

#include "core/config.h"
#include "core/types.h"

namespace evac {

/// Reads a task from its YAML page (docs/add_a_task.md): id, instruction, arms, cameras, period_s, max_chunks, still, workspace,
/// rubric. Sections that only some worlds read (`mujoco:`) stay in `Task::page`.
/// @throws InvalidInput naming file, line, field, what was found and what was wanted.
Task ReadTaskPage(const std::filesystem::path& path);
/// The same from a text, e.g. the one a store kept.
Task ParseTaskPage(const std::string& text, const std::filesystem::path& path);

/// A section `still` of a task or a suite; what it leaves out is as in `otherwise`.
/// @throws InvalidInput naming file, line and field: an unknown one, or a number out of its range.
StillRule ReadStillRule(const Config& page, const StillRule& otherwise);

/// A rubric that people and models read, where no physics is to be asked: `success`, and if there are any `stages`, each of
/// a name and a description. @throws InvalidInput as above
Rubric ReadRubricInWords(const Config& page);

/// A box of the base frame: `min` and `max`, metres. @throws InvalidInput as above
Eigen::AlignedBox3d ReadWorkspace(const Config& page);

}  // namespace evac
