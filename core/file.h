#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace evac {

/// @throws Error naming the file if it cannot be read.
std::string ReadFile(const std::filesystem::path& path);

/// Writes beside it, syncs, renames, syncs the folder: the file is there whole or not at all, also after a power cut, and
/// whoever else writes the same file meanwhile. A link stays one: written is the file that it leads to.
/// @throws InvalidInput naming it if what is there is no regular file (a folder, a device, a pipe), or as StatusOf; Error
///   naming the file and the system's reason.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

/// The same file under another name, at which nothing is: a hard link, or where the disk has none a copy that is there
/// whole or not at all. @throws Error naming the file and the system's reason.
void LinkOrCopy(const std::filesystem::path& from, const std::filesystem::path& to);

/// Syncs a finished file to disk, renames it to its final name and syncs that folder.
void SyncAndRename(const std::filesystem::path& from, const std::filesystem::path& to);

/// What is at a path, links followed: of type not_found where nothing is.
/// @throws InvalidInput naming it and the reason where nobody can know: a link to itself, a folder without rights, a
///   name that is too long.
std::filesystem::file_status StatusOf(const std::filesystem::path& path);

/// Makes a folder and those above it, as far as they are missing, each of them synced into the one above.
/// @throws InvalidInput naming what is no folder where one is wanted, or as StatusOf; Error naming the folder that
///   cannot be made.
void MakeFolders(const std::filesystem::path& folder);

/// For a file that is written at the end of long work: whether one can be there is known before.
/// @throws InvalidInput naming it if it is a folder, or ends like one, or is anything else that is no regular file.
void RefuseFolder(const std::filesystem::path& file);

}  // namespace evac
