#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// Where recordings lie (docs/formats/recording.md).
namespace evac {

/// Whether the folder is one recording, by the files that are there: what ReadRecording would read, whole or broken.
bool IsRecording(const std::filesystem::path& folder);

/// Every folder below `input` that is meant as a recording, sorted: the episodes of an AgiBot World tree, of one of its
/// tasks (ROOT/observations/<task>), `input` itself, or its subfolders. @throws InvalidInput if there is none.
std::vector<std::filesystem::path> FindRecordings(const std::filesystem::path& input);

/// What may be called by a recording's or a task's folder: safe in a path and in a URL.
std::string SafeName(std::string name);

}  // namespace evac
