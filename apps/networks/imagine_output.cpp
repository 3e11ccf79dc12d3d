#include "apps/networks/imagine_output.h"

#include <fmt/format.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

fs::path Beside(const fs::path& folder, const char* ending) { return folder.string() + ending; }

void Rename(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw InternalError("{}: cannot be renamed from {}: {}", to.string(), from.string(), error.message());
}

}  // namespace

PictureFolder::PictureFolder(fs::path folder) : folder_(std::move(folder)), partial_(Beside(folder_, ".tmp")) {
  std::error_code ignored;
  fs::remove_all(partial_, ignored);  // of a process that was killed
  MakeFolders(partial_);
}

PictureFolder::~PictureFolder() {
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
}

void PictureFolder::Append(const cv::Mat& rgb) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", bgr, bytes)) throw InternalError("{}: a picture cannot be encoded", folder_.string());
  const fs::path path = partial_ / fmt::format("frame_{:05}.png", count_++);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw InternalError("{}: cannot be written", path.string());
}

void PictureFolder::Finish() {
  const fs::path before = Beside(folder_, ".old");
  std::error_code ignored;
  fs::remove_all(before, ignored);
  if (fs::exists(folder_)) Rename(folder_, before);
  Rename(partial_, folder_);
  fs::remove_all(before, ignored);
}

cv::Mat PictureAboveMap(const cv::Mat& picture, const cv::Mat& map) {
  cv::Mat both;
  cv::vconcat(picture, map, both);
  return both;
}

}  // namespace evac
