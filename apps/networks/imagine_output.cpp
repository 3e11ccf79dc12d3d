#include "apps/networks/imagine_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

fs::path PartialOf(const fs::path& folder) { return folder.string() + ".tmp"; }

void Rename(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw InternalError("{}: cannot be renamed from {}: {}", to.string(), from.string(), error.message());
}

/// frame_00000.png
bool IsPicture(const fs::directory_entry& entry) {
  const std::string name = entry.path().filename().string();
  constexpr std::size_t kBefore = 6, kAfter = 4;
  if (!name.starts_with("frame_") || !name.ends_with(".png") || name.size() < kBefore + 5 + kAfter) return false;
  return std::all_of(name.begin() + kBefore, name.end() - kAfter, [](char c) { return c >= '0' && c <= '9'; }) &&
         entry.symlink_status().type() == fs::file_type::regular;
}

bool HoldsOnly(const fs::path& folder, bool (*is_own)(const fs::directory_entry&)) {
  return fs::is_directory(fs::symlink_status(folder)) &&
         std::all_of(fs::directory_iterator(folder), fs::directory_iterator(), is_own);
}

bool IsPart(const fs::directory_entry& entry) {
  return (entry.path().filename() == "new" || entry.path().filename() == "old") && HoldsOnly(entry.path(), IsPicture);
}

}  // namespace

void RequireOwnPictures(const fs::path& folder) {
  const auto require = [](const fs::path& place, bool (*is_own)(const fs::directory_entry&)) {
    const bool is_free = fs::symlink_status(place).type() == fs::file_type::not_found || HoldsOnly(place, is_own);
    if (!is_free)
      throw InvalidInput("{}: is there, and would be replaced, but is no folder of nothing but evac's pictures "
                         "(frame_00000.png, …); wanted that name free, or another --out", place.string());
  };
  require(folder, IsPicture);
  require(PartialOf(folder), IsPart);
}

PictureFolder::PictureFolder(fs::path folder) : folder_(std::move(folder)), partial_(PartialOf(folder_)) {
  RequireOwnPictures(folder_);
  std::error_code ignored;
  fs::remove_all(partial_, ignored);  // of a process that was killed
  MakeFolders(partial_ / "new");
}

PictureFolder::~PictureFolder() {
  std::error_code ignored;
  fs::remove_all(partial_ / "new", ignored);
  fs::remove(partial_, ignored);
}

void PictureFolder::Append(const cv::Mat& rgb) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", bgr, bytes)) throw InternalError("{}: a picture cannot be encoded", folder_.string());
  const fs::path path = partial_ / "new" / fmt::format("frame_{:05}.png", count_++);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw InternalError("{}: cannot be written", path.string());
}

void PictureFolder::Finish() {
  RequireOwnPictures(folder_);
  if (fs::exists(folder_)) Rename(folder_, partial_ / "old");
  Rename(partial_ / "new", folder_);
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
}

cv::Mat PictureAboveMap(const cv::Mat& picture, const cv::Mat& map) {
  cv::Mat both;
  cv::vconcat(picture, map, both);
  return both;
}

}  // namespace evac
