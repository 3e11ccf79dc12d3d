#include "tests/architecture/rules.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>

#include "tests/architecture/source_text.h"

namespace evac::architecture {
namespace {

namespace fs = std::filesystem;

const std::set<std::string> kTopFolders = {"core", "worldmodel", "policies", "judges", "harness", "reports",
                                           "apps", "tests",      "docs",     "cmake",  ".ci"};
const std::set<std::string> kModules = {"core",    "worldmodel", "policies", "judges",
                                        "harness", "reports",    "apps",     "tests"};

std::string At(const SourceFile& file, int line, const std::string& what) {
  return file.path + ":" + std::to_string(line) + ": " + what;
}

std::string FirstFolder(const std::string& path) {
  const std::size_t slash = path.find('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

bool IsBelow(const std::string& path, const std::string& folder) { return path.rfind(folder + "/", 0) == 0; }

/// "worldmodel/nn" for a file in one of the parts with rules of their own, else the module.
std::string PartOf(const std::string& path) {
  for (const char* part : {"worldmodel/nn", "worldmodel/train", "worldmodel/sim"}) {
    if (IsBelow(path, part)) return part;
  }
  return FirstFolder(path);
}

bool MayInclude(const std::string& from, const std::string& included) {
  const std::string part = PartOf(from), target = PartOf(included);
  if (part == "apps" || part == "tests" || part == target) return true;
  if (part == "worldmodel/nn" || part == "worldmodel/train") {
    return included == "core/tensor_file.h" || (part == "worldmodel/train" && target == "worldmodel/nn");
  }
  if (part == "worldmodel" && target == "worldmodel/nn") return true;
  return target == "core";
}

struct Library {
  std::regex header;
  std::regex home;
  const char* rule;
};

const std::array<Library, 3>& Libraries() {
  static const std::array<Library, 3> libraries = {{
      {std::regex("^libav|^libsw(scale|resample)/"), std::regex("^core/video[^/]*$"),
       "libav belongs in core/video.* alone"},
      {std::regex("^sqlite3"), std::regex("^core/store[^/]*$"), "SQLite belongs in core/store* alone"},
      {std::regex("^(torch|ATen|c10)/"), std::regex("^worldmodel/(nn|train)/|^judges/classifier_[^/]*$|^policies/learned_[^/]*$"),
       "torch belongs in worldmodel/nn, worldmodel/train, judges/classifier_* and policies/learned_* alone"},
  }};
  return libraries;
}

std::set<std::string> IgnoredFolders(const fs::path& root) {
  std::set<std::string> ignored = {".git"};
  std::ifstream lines(root / ".gitignore");
  for (std::string line; std::getline(lines, line);) {
    if (line.size() > 2 && line.front() == '/' && line.back() == '/') ignored.insert(line.substr(1, line.size() - 2));
  }
  return ignored;
}

bool IsText(const std::string& path) {
  static const std::set<std::string> kExtensions = {".h",   ".cpp",  ".md",  ".txt",  ".cmake", ".yaml",
                                                    ".yml", ".lcm",  ".xml", ".in",   ".json",  ".js",
                                                    ".css", ".html", ".sh",  ".toml", ".py",    ".csv",
                                                    ".tsv", ""};
  return kExtensions.count(fs::path(path).extension().string()) > 0;
}

}  // namespace

bool IsCpp(const std::string& path) { return path.ends_with(".h") || path.ends_with(".cpp"); }

Violations BrokenIncludeArrows(const SourceFile& file) {
  Violations violations;
  for (const Include& include : FindIncludes(file.text)) {
    const bool ours = kModules.count(FirstFolder(include.path)) > 0;
    if (include.quoted && !ours) {
      violations.push_back(
          At(file, include.line,
             "\"" + include.path + "\": our headers are included by their path from the root, others with <>"));
    } else if (ours && !MayInclude(file.path, include.path)) {
      violations.push_back(At(
          file, include.line,
          PartOf(file.path) + " may not include " + include.path + ": own module and core only (see ARCHITECTURE.md)"));
    }
  }
  return violations;
}

Violations MisplacedLibraries(const SourceFile& file) {
  Violations violations;
  if (FirstFolder(file.path) == "tests") return violations;
  for (const Include& include : FindIncludes(file.text)) {
    for (const Library& library : Libraries()) {
      if (!std::regex_search(include.path, library.header) || std::regex_search(file.path, library.home)) continue;
      violations.push_back(At(file, include.line, include.path + ": " + library.rule));
    }
  }
  return violations;
}

Violations TooLong(const SourceFile& file) {
  Violations violations;
  const auto lines = static_cast<int>(std::count(file.text.begin(), file.text.end(), '\n'));
  if (lines > kMaxFileLines) {
    violations.push_back(At(file, kMaxFileLines + 1,
                            std::to_string(lines) + " lines: a file has at most " + std::to_string(kMaxFileLines)));
  }
  for (const FunctionSpan& function : FindFunctions(file.text)) {
    if (function.Lines() <= kMaxFunctionLines) continue;
    violations.push_back(At(file, function.first_line,
                            std::to_string(function.Lines()) + " lines in '" + function.head.substr(0, 80) +
                                "': a function has at most " + std::to_string(kMaxFunctionLines)));
  }
  return violations;
}

Violations MachinePaths(const SourceFile& file) {
  static const std::regex kPath("(^|[^A-Za-z0-9_./~$}>-])/(work|home|root|Users)/[A-Za-z0-9_.-]");
  Violations violations;
  std::istringstream lines(file.text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (std::regex_search(line, kPath))
      violations.push_back(At(file, number, "a path of one machine: paths are relative, or arguments"));
  }
  return violations;
}

Violations MissingSources(const SourceFile& file) {
  static const std::regex kSection(
      "\\b((statistics|rating|vlm_judge|reports|desk_model|conventions|platform|house)\\.md|spec) [0-9]");
  Violations violations;
  std::istringstream lines(file.text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (std::regex_search(line, kSection))
      violations.push_back(
          At(file, number, "a section of a document that is not here: name a paper, a method or a page of docs/"));
  }
  return violations;
}

Violations UnknownTopFolders(const std::vector<std::string>& folders) {
  Violations violations;
  for (const std::string& folder : folders) {
    if (kTopFolders.count(folder) > 0) continue;
    violations.push_back(folder +
                         "/:1: a new folder at the top needs a decision record (docs/decisions) and its name in "
                         "tests/architecture/rules.cpp");
  }
  return violations;
}

std::vector<std::string> TopFolders(const fs::path& root) {
  const std::set<std::string> ignored = IgnoredFolders(root);
  std::vector<std::string> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(root)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && ignored.count(name) == 0) folders.push_back(name);
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

std::vector<SourceFile> ReadTree(const fs::path& root) {
  const std::set<std::string> ignored = IgnoredFolders(root);
  std::vector<SourceFile> files;
  for (auto it = fs::recursive_directory_iterator(root); it != fs::recursive_directory_iterator(); ++it) {
    if (it.depth() == 0 && it->is_directory() && ignored.count(it->path().filename().string()) > 0) {
      it.disable_recursion_pending();
      continue;
    }
    const std::string path = fs::relative(it->path(), root).generic_string();
    if (!it->is_regular_file() || !IsText(path)) continue;
    std::ifstream stream(it->path(), std::ios::binary);
    files.push_back({path, std::string(std::istreambuf_iterator<char>(stream), {})});
  }
  std::sort(files.begin(), files.end(), [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

}  // namespace evac::architecture
