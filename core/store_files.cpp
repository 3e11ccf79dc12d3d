#include "core/store_files.h"

#include <vector>

#include "core/error.h"

namespace evac::run_files {
namespace {

namespace fs = std::filesystem;

bool LeadsOut(const fs::path& relative) {
  return relative.empty() || relative.is_absolute() || relative != relative.lexically_normal() ||
         *relative.begin() == "..";
}

std::string NameOf(const EpisodeKey& key, const char* folder, const char* extension) {
  const fs::path relative = key.Id() + extension;
  if (LeadsOut(relative)) throw InvalidInput("episode '{}': its names cannot be parts of a path", key.Id());
  return (folder / relative).string();
}

}  // namespace

std::string VideoName(const EpisodeKey& key) { return NameOf(key, kVideos, ".mp4"); }
std::string ThumbnailName(const EpisodeKey& key) { return NameOf(key, kThumbnails, ".jpg"); }

std::string NameInside(const fs::path& folder, const fs::path& file) {
  const fs::path relative = fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder));
  if (LeadsOut(relative) || relative == ".")
    throw InternalError("{}: is outside the run's folder {}", file.string(), folder.string());
  if (!fs::is_regular_file(file)) throw InternalError("{}: is not there", file.string());
  return relative.generic_string();
}

void RequireNoOthersFiles(const fs::path& folder) {
  for (const char* part : {kVideos, kThumbnails}) {
    const fs::path found = folder / part;
    const fs::file_status status = fs::symlink_status(found);
    const bool is_free = status.type() == fs::file_type::not_found || (fs::is_directory(status) && fs::is_empty(found));
    if (!is_free)
      throw InvalidInput("{}: is there, and of no run ({} is missing); wanted that name free, or another folder for the "
                         "run", found.string(), kDatabase);
  }
}

void RemoveAllBut(const std::set<std::string>& names, const fs::path& folder) {
  std::vector<fs::path> orphans;
  for (const char* part : {kVideos, kThumbnails}) {
    if (!fs::is_directory(fs::symlink_status(folder / part))) continue;  // through a link would be somebody's
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder / part)) {
      const bool is_named = names.contains(entry.path().lexically_relative(folder).generic_string());
      if (!entry.is_directory() && !is_named) orphans.push_back(entry.path());
    }
  }
  for (const fs::path& orphan : orphans) {
    std::error_code error;
    fs::remove(orphan, error);
    if (error) throw InternalError("{}: cannot be removed: {}", orphan.string(), error.message());
  }
}

}  // namespace evac::run_files
