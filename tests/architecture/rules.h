#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// The hard rules of ARCHITECTURE.md, as functions of one file's path and text: so that they can be tried on samples.
namespace evac::architecture {

struct SourceFile {
  std::string path;  ///< from the project's root, '/' between folders
  std::string text;
};

inline constexpr int kMaxFileLines = 500;
inline constexpr int kMaxFunctionLines = 60;

/// "core/video.cpp:12: what is wrong: the rule". Empty when the file keeps every rule.
using Violations = std::vector<std::string>;

/// A file includes its own module and core; apps and tests are free. Inside worldmodel: train → nn, worldmodel → nn,
/// sim → sim.
Violations BrokenIncludeArrows(const SourceFile& file);
/// libav in core/video alone, SQLite in core/store alone, torch in worldmodel/nn, worldmodel/train, judges/classifier_*
/// and policies/learned_* alone (docs/decisions/0041-small-networks.md). Tests are free.
Violations MisplacedLibraries(const SourceFile& file);
/// At most 500 lines a file and 60 a function. For .h and .cpp.
Violations TooLong(const SourceFile& file);
/// No path of one person's machine in anything that is kept.
Violations MachinePaths(const SourceFile& file);
/// No section of a document that is not in the project: a source is a paper, a published method or a page of docs/.
Violations MissingSources(const SourceFile& file);
/// A new folder at the top needs a decision record, and its name here.
Violations UnknownTopFolders(const std::vector<std::string>& folders);

/// Every kept text file below `root`: what .gitignore names as "/folder/" is left out, and so is .git.
std::vector<SourceFile> ReadTree(const std::filesystem::path& root);
std::vector<std::string> TopFolders(const std::filesystem::path& root);
bool IsCpp(const std::string& path);

}  // namespace evac::architecture
