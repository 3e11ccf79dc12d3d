#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "core/types.h"

/// The files of a run beside its database. Names are relative to the run's folder, with '/'.
namespace evac::run_files {

inline constexpr const char* kDatabase = "evac.sqlite";
inline constexpr const char* kLock = "lock";
inline constexpr const char* kVideos = "videos";
inline constexpr const char* kThumbnails = "thumbs";

/// "videos/<id>.mp4", "thumbs/<id>.jpg". @throws InvalidInput if the id would lead out of the folder.
std::string VideoName(const EpisodeKey& key);
std::string ThumbnailName(const EpisodeKey& key);

/// @throws InternalError if `file` is not below `folder`, or not there.
std::string NameInside(const std::filesystem::path& folder, const std::filesystem::path& file);

/// @throws InvalidInput if videos/ or thumbs/ hold anything, or are links: in a folder without a run that is somebody's
void RequireNoOthersFiles(const std::filesystem::path& folder);

/// Removes what is below videos/ and thumbs/ and not among `names`; nothing where one of them is a link.
void RemoveAllBut(const std::set<std::string>& names, const std::filesystem::path& folder);

}  // namespace evac::run_files
