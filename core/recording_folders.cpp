#include "core/recording_folders.h"

#include <algorithm>
#include <cctype>

#include "core/collection.h"
#include "core/error.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> SubFolders(const fs::path& folder) {
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

bool LooksLikeRecording(const fs::path& folder) {
  return fs::exists(folder / "action.npy") || fs::exists(folder / "proprio_stats.h5") || PlaceOf(folder).has_value();
}

}  // namespace

bool IsRecording(const fs::path& folder) {
  const fs::path absolute = fs::weakly_canonical(folder);
  if (!fs::is_directory(absolute)) return false;
  return LooksLikeRecording(absolute) || (absolute.filename() == "videos" && PlaceOf(absolute.parent_path()));
}

std::vector<fs::path> FindRecordings(const fs::path& input) {
  std::error_code error;
  const fs::path root = fs::canonical(input, error);
  if (error || !fs::is_directory(root)) throw InvalidInput("{}: no such folder", input.string());
  std::vector<fs::path> found;
  if (fs::is_directory(root / "observations")) {
    for (const fs::path& task : SubFolders(root / "observations")) {
      for (const fs::path& episode : SubFolders(task)) found.push_back(episode);
    }
  } else if (LooksLikeRecording(root)) {
    found.push_back(root);
  } else {
    for (const fs::path& folder : SubFolders(root)) {
      if (LooksLikeRecording(folder)) found.push_back(folder);
    }
  }
  if (!found.empty()) return found;
  throw InvalidInput(
      "{}: no recordings; wanted an AgiBot World tree (observations/<task>/<episode>), a recording, or a folder of "
      "recordings (docs/formats/recording.md)",
      input.string());
}

std::string SafeName(std::string name) {
  for (char& letter : name) {
    if (!std::isalnum(static_cast<unsigned char>(letter)) && letter != '-' && letter != '_' && letter != '.')
      letter = '_';
  }
  return name.empty() || name.front() == '.' ? "recording" + name : name;
}

}  // namespace evac
