#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/config.h"
#include "harness/suite.h"

namespace evac {

/// SHA-256 of what a page says, and of every file that a scalar in it names (the scene, whatever it is called), and of
/// what those are made of (core/scene_files.h).
std::string PageHash(const std::filesystem::path& page);

/// Between the reading of a suite and a world's turn lie hours: what the world was made of is to be what the suite's
/// hash says. To be called after its profile and the tasks' scenes were read, so that what was written to meanwhile is
/// noticed.
/// @throws InvalidInput naming the page and both hashes if the profile, a task's page or a file that one of them names
///   is another by now.
void DemandUnchanged(const Suite& suite, const SuiteWorld& world);

/// The kind of the errors of the two below: whoever catches what an episode's world throws lets it through, so that it
/// ends the run and is no failure of the episode's.
inline constexpr const char* kChangedError = "changed";

/// The same of what a policy is made of. To be called whenever a process of it has declared itself, which has read its
/// files by then.
/// @throws InvalidInput naming the file and both hashes if one of its `files`, or of the recording that its command
///   names, is another by now, or gone. A file that has come since is nobody's.
void DemandUnchanged(const Suite& suite, const SuitePolicy& policy);

/// The same of one of the suite's recordings, whenever it was read.
void DemandRecordingUnchanged(const Suite& suite, const std::filesystem::path& recording);

/// All files of the policies and of the recording that the suite's hash covers, as they are now.
/// @throws InvalidInput naming what cannot be read
std::map<std::filesystem::path, HashedFile> HashFiles(const Suite& suite);

/// SHA-256 of everything in a suite that can change a result, wherever its files lie: fields by value, files by
/// content, a recording also by what its task is called, from which seeds are drawn. In a recording's own folders those
/// files count that ReadRecording may read (IsReadOfRecording), all of them if a policy is told where it lies. Left out:
/// lanes, threads, error_budget and the transport's times, which change how fast and how patiently, not what; a
/// collection's `lock`; folders called __pycache__ in those that a policy's `files` list, into which Python writes as
/// it starts.
std::string SuiteHash(const Config& page, const Suite& suite);

/// The same without the worlds of type evac, the policies and how many initial states there are: suites that differ in
/// these alone have the same reality, and what a policy that both have did in it is the same.
std::string RealityHash(const Config& page, const Suite& suite);

/// SHA-256 of all that decides what a policy does, as its suite says it: its name and checkpoint, its command or where it
/// listens, and its `files` by content (as in the suite's hash, without Python's __pycache__).
std::string PolicyHash(const SuitePolicy& policy);

/// The arguments of a policy's command that name files or folders which its `files` do not list, but for the suite's
/// own folder. They may decide what it does, and they may be what it writes: only the suite's author knows.
std::vector<std::string> FilesInNoHash(const Suite& suite, const SuitePolicy& policy);

}  // namespace evac
