#include "core/recording_folders.h"

#include <algorithm>
#include <cctype>

#include "core/error.h"
#include "core/recording.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// Those that cannot be looked at too; one that cannot be listed is in its own list: who reads it says why.
std::vector<fs::path> SubFolders(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code error, unknown;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const fs::file_status found = at->status(unknown);
    if (fs::is_directory(found) || !fs::status_known(found)) folders.push_back(at->path());
  }
  if (error) folders.push_back(folder);
  std::sort(folders.begin(), folders.end());
  return folders;
}

/// Or cannot be known not to be.
bool IsThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error) || error;
}

bool LooksLikeRecording(const fs::path& folder) {
  return IsThere(folder / "action.npy") || IsThere(folder / "proprio_stats.h5") || PlaceOf(folder).has_value();
}

/// Whole or broken.
bool IsMeantAsRecording(const fs::path& folder) {
  return LooksLikeRecording(folder) || !FirstPictureIn(folder).empty();
}

bool IsHidden(const fs::path& folder) { return folder.filename().string().starts_with("."); }

}  // namespace

fs::path FirstPictureIn(const fs::path& folder) {
  fs::path first;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (name != "frame.png" && !name.ends_with("_color.mp4")) continue;
    if (first.empty() || at->path() < first) first = at->path();
  }
  return first;
}

bool IsRecording(const fs::path& folder) {
  std::error_code error;
  const fs::path absolute = fs::weakly_canonical(folder, error);
  if (error || !fs::is_directory(absolute, error)) return false;
  return LooksLikeRecording(absolute) || (absolute.filename() == "videos" && PlaceOf(absolute.parent_path()));
}

std::vector<fs::path> FindRecordings(const fs::path& input) {
  std::error_code error;
  const fs::path root = fs::canonical(input, error);
  if (error || !fs::is_directory(root, error)) throw InvalidInput("{}: no such folder", input.string());
  std::vector<fs::path> found;
  if (fs::is_directory(root / "observations", error)) {
    for (const fs::path& task : SubFolders(root / "observations")) {
      for (const fs::path& episode : SubFolders(task)) found.push_back(episode);
    }
  } else if (LooksLikeRecording(root)) {
    found.push_back(root);
  } else {
    for (const fs::path& folder : SubFolders(root)) {
      if (IsMeantAsRecording(folder)) found.push_back(folder);
    }
    if (found.empty() && IsMeantAsRecording(root)) found.push_back(root);
  }
  if (!found.empty()) return found;
  throw InvalidInput(
      "{}: no recordings; wanted an AgiBot World tree (observations/<task>/<episode>), a recording, or a folder of "
      "recordings (docs/formats/recording.md)",
      input.string());
}

std::vector<fs::path> PassedOver(const fs::path& input) {
  std::error_code error;
  const fs::path root = fs::canonical(input, error);
  if (fs::is_directory(root / "observations", error)) return {};
  const std::vector<fs::path> found = FindRecordings(input);
  if (found.front() == root) return {};
  std::vector<fs::path> others;
  for (const fs::path& folder : SubFolders(root)) {
    if (!IsHidden(folder) && !std::ranges::binary_search(found, folder)) others.push_back(folder);
  }
  return others;
}

std::string TaskNameOf(const fs::path& folder, const std::optional<CollectedEpisode>& row, const fs::path& all) {
  if (row) return SafeName(row->task);
  const std::optional<TreePlace> place = PlaceOf(folder);
  return SafeName(place ? place->task : fs::canonical(all).filename().string());
}

std::string RecordedTaskName(const fs::path& recording) {
  if (IsRecording(recording)) return RecordingId(recording);
  const fs::path first = FindRecordings(recording).front();
  return TaskNameOf(first, RowOf(first), recording);
}

std::string SafeName(std::string name) {
  for (char& letter : name) {
    if (!std::isalnum(static_cast<unsigned char>(letter)) && letter != '-' && letter != '_' && letter != '.')
      letter = '_';
  }
  return name.empty() || name.front() == '.' ? "recording" + name : name;
}

}  // namespace evac
