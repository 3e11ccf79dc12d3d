#include "judges/rating_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/video.h"

namespace evac {
namespace {

int Even(double value) { return std::max(2, 2 * static_cast<int>(std::lround(value / 2))); }

/// One picture of the source as raters see it.
cv::Mat Shown(const cv::Mat& source, const Task& task, const ClipLayout& layout, const ClipFormat& format,
              const ClipRoundTrip& round_trip) {
  cv::Mat picture(format.height_px, format.width_px, CV_8UC3, cv::Scalar::all(0));
  const int left = (format.width_px - layout.width_px) / 2, top = (format.height_px - layout.height_px) / 2;
  double width_px = 0;
  for (const Camera& camera : task.cameras) width_px += camera.width_px;
  const double scale = source.cols / width_px;  // runs may enlarge small frames
  double at = 0;
  for (std::size_t i = 0; i < task.cameras.size(); ++i) {
    const Camera& camera = task.cameras[i];
    const int x = static_cast<int>(std::lround(at * scale));
    const cv::Rect from(x, 0, std::min(static_cast<int>(std::lround(camera.width_px * scale)), source.cols - x),
                        std::min(static_cast<int>(std::lround(camera.height_px * scale)), source.rows));
    const ViewPlace& view = layout.views[i];
    cv::Mat into = picture(cv::Rect(left + view.x_px, top + view.y_px, view.width_px, view.height_px));
    cv::Mat seen = source(from);
    if (round_trip.show) {
      cv::resize(seen, seen, {camera.width_px, camera.height_px}, 0, 0, cv::INTER_AREA);
      seen = round_trip.show(seen);
    }
    const bool shrinks = view.width_px < seen.cols;
    cv::resize(seen, into, into.size(), 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_CUBIC);
    at += camera.width_px;
  }
  return picture;
}

void CheckWidth(const VideoReader& reader, const Task& task, const std::filesystem::path& source) {
  int width_px = 0;
  for (const Camera& camera : task.cameras) width_px += camera.width_px;
  if (width_px == 0) throw InvalidInput("{}: task {} has no cameras", source.string(), task.id);
  const double scale = static_cast<double>(reader.width_px()) / width_px;
  if (scale < 0.99)
    throw InvalidInput("{}: is {} px wide, wanted {} px or more: the cameras of task {}", source.string(),
                       reader.width_px(), width_px, task.id);
}

}  // namespace

ClipLayout LayoutOf(const std::vector<Camera>& cameras, int height_px) {
  ClipLayout layout;
  if (cameras.empty()) return layout;
  const auto width_at = [](const Camera& camera, double height) {
    return Even(height * camera.width_px / std::max(1, camera.height_px));
  };
  layout.height_px = Even(height_px);
  const int main_width = width_at(cameras[0], layout.height_px);
  layout.views.push_back({cameras[0].name, 0, 0, main_width, layout.height_px});
  const auto others = static_cast<int>(cameras.size()) - 1;
  const int each = others == 0 ? 0 : layout.height_px / std::max(2, others) / 2 * 2;
  int column = 0;
  for (int i = 0; i < others; ++i) {
    const Camera& camera = cameras[static_cast<std::size_t>(i) + 1];
    layout.views.push_back({camera.name, main_width, i * each, width_at(camera, each), each});
    column = std::max(column, layout.views.back().width_px);
  }
  layout.width_px = main_width + column;
  return layout;
}

std::string ViewsJson(const ClipLayout& layout, int width_px, int height_px) {
  const double left = (width_px - layout.width_px) / 2.0, top = (height_px - layout.height_px) / 2.0;
  nlohmann::ordered_json views = nlohmann::ordered_json::array();
  for (const ViewPlace& view : layout.views) {
    views.push_back({{"name", view.name},
                     {"x", (left + view.x_px) / width_px},
                     {"y", (top + view.y_px) / height_px},
                     {"width", static_cast<double>(view.width_px) / width_px},
                     {"height", static_cast<double>(view.height_px) / height_px}});
  }
  return views.dump();
}

int EncodeClip(const std::filesystem::path& source, const Task& task, const ClipLayout& layout,
               const ClipFormat& format, const ClipRoundTrip& round_trip, const std::filesystem::path& target) {
  VideoReader reader(source);
  CheckWidth(reader, task, source);
  VideoWriter writer(target, {.period_s = format.period_s, .crf = format.crf});
  int frames = 0;
  for (cv::Mat frame = reader.Next(); !frame.empty(); frame = reader.Next()) {
    const double until_s = reader.time_s() + task.period_s;
    const cv::Mat picture = Shown(frame, task, layout, format, round_trip);
    for (; frames * format.period_s < until_s - 1e-6; ++frames) writer.Append(picture);
  }
  if (frames == 0) throw InvalidInput("{}: has no frames", source.string());
  writer.Finish();
  return frames;
}

void PadClip(const std::filesystem::path& file, std::uintmax_t bytes, const std::filesystem::path& padded) {
  constexpr std::uintmax_t kHeader = 8;
  std::string content = ReadFile(file);
  if (content.size() + kHeader > bytes)
    throw InternalError("{}: is {} bytes long, wanted at most {}", file.string(), content.size(), bytes - kHeader);
  const std::uintmax_t box = bytes - content.size();
  for (int shift = 24; shift >= 0; shift -= 8) content += static_cast<char>((box >> shift) & 0xFF);
  content += "free";
  content.resize(bytes, '\0');
  WriteFileAtomically(padded, content);
}

}  // namespace evac
