#include "judges/classifier_clip.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/video.h"

namespace evac {
namespace {

/// How many pixels of the clip each pixel of the cameras became. An odd side is a pixel longer in H.264.
int ScaleOf(const std::filesystem::path& video, const cv::Size& found_px, const std::vector<Camera>& cameras) {
  cv::Size together_px(0, 0);
  for (const Camera& camera : cameras) {
    together_px.width += camera.width_px;
    together_px.height = std::max(together_px.height, camera.height_px);
  }
  const int scale = together_px.width > 0 ? found_px.width / together_px.width : 0;
  const cv::Size extra_px(found_px.width - scale * together_px.width, found_px.height - scale * together_px.height);
  const auto is_padding = [](int extra) { return extra == 0 || extra == 1; };
  if (scale < 1 || !is_padding(extra_px.width) || !is_padding(extra_px.height))
    throw InvalidInput("{}: pictures of {}x{} pixels, wanted {}x{} (the task's {} cameras side by side) or a multiple",
                       video.string(), found_px.width, found_px.height, together_px.width, together_px.height,
                       cameras.size());
  return scale;
}

/// One camera's part of a frame, in the size asked for.
cv::Mat Part(const cv::Mat& frame, const cv::Rect& part, const cv::Size& picture_px) {
  cv::Mat small;
  const bool shrinks = picture_px.width <= part.width && picture_px.height <= part.height;
  cv::resize(frame(part), small, picture_px, 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
  return small;
}

}  // namespace

std::vector<int> EvenlySpaced(int frames, int count) {
  std::vector<int> rows;
  for (int i = 0; i < count; ++i)
    rows.push_back(count == 1 ? frames - 1 : (i * (frames - 1) + (count - 1) / 2) / (count - 1));
  return rows;
}

std::vector<std::vector<cv::Mat>> ReadClip(const std::filesystem::path& video, const ClipLook& look) {
  VideoReader reader(video);
  const int scale = ScaleOf(video, {reader.width_px(), reader.height_px()}, look.cameras);
  if (reader.frames() < 1) throw InvalidInput("{}: does not say how many frames it has", video.string());
  if (look.most_frames > 0 && reader.frames() > look.most_frames)
    throw InvalidInput("{}: {} frames, wanted at most {}: longer than anything its judge learned from", video.string(),
                       reader.frames(), look.most_frames);
  std::vector<std::vector<cv::Mat>> views(look.cameras.size());
  int at = 0;
  cv::Mat frame;
  for (const int row : EvenlySpaced(reader.frames(), look.frames)) {
    for (; at < row; ++at) reader.Skip();
    if (at == row) frame = reader.Next(), ++at;
    if (frame.empty()) throw InvalidInput("{}: ends after {} of {} frames", video.string(), at - 1, reader.frames());
    int x_px = 0;
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Camera& camera = look.cameras[v];
      views[v].push_back(Part(frame, {x_px, 0, scale * camera.width_px, scale * camera.height_px}, look.picture_px));
      x_px += scale * camera.width_px;
    }
  }
  return views;
}

}  // namespace evac
