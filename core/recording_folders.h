#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/collection.h"

/// Where recordings lie (docs/formats/recording.md).
namespace evac {

/// Whether the folder is one recording, by the files that are there: what ReadRecording would read, whole or broken.
bool IsRecording(const std::filesystem::path& folder);

/// The first file by name in the folder itself that is a recording's picture: …_color.mp4 or frame.png. Empty: none.
std::filesystem::path FirstPictureIn(const std::filesystem::path& folder);

/// Every folder below `input` that is meant as a recording, sorted: the episodes of an AgiBot World tree, of one of its
/// tasks (ROOT/observations/<task>), `input` itself, or its subfolders. One that cannot be looked into may be one, and
/// so may one with pictures and without the arms' track: they are among them, for ReadRecording to refuse.
/// @throws InvalidInput if there is none.
std::vector<std::filesystem::path> FindRecordings(const std::filesystem::path& input);

/// Where FindRecordings finds subfolders of `input`: the others, sorted, which are not looked into; but for hidden ones
/// (.git). @throws InvalidInput as FindRecordings
std::vector<std::filesystem::path> PassedOver(const std::filesystem::path& input);

/// The task that one of several recordings is of: its row's where it was collected, else its tree's, else what `all`, the
/// folder of them, is called. @param row  RowOf(folder)
std::string TaskNameOf(const std::filesystem::path& folder, const std::optional<CollectedEpisode>& row,
                       const std::filesystem::path& all);

/// What the task is called that begins with a recording, or with each of a folder of several: one alone like itself,
/// several like the task of the first. @throws InvalidInput if there is none.
std::string RecordedTaskName(const std::filesystem::path& recording);

/// What may be called by a recording's or a task's folder: safe in a path and in a URL.
std::string SafeName(std::string name);

}  // namespace evac
