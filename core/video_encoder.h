#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "core/video.h"
#include "core/video_av.h"

namespace evac {

/// One mp4 being written, in the caller's thread. Until it is finished, its destruction removes the file. What
/// VideoWriter promises is made here; core/video_writer.cpp gives it a thread.
class VideoEncoder {
 public:
  VideoEncoder(std::filesystem::path path, const VideoOptions& options);
  ~VideoEncoder();
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  /// @param rgb  CV_8UC3, all of one size.
  void Append(const cv::Mat& rgb);
  FinishedVideo Finish();

  const std::filesystem::path& path() const { return path_; }

 private:
  /// Ticks of 1 / per_s seconds, `per_frame` of them from one frame to the next.
  struct Ticks {
    int per_s = 0;
    int per_frame = 0;
  };
  static Ticks TicksFor(double period_s);

  void Start(int width_px, int height_px);
  void SetUpCodec(int width_px, int height_px);
  void WriteHeader();
  void Encode(const AVFrame* frame_or_end);
  void Demand(int code, const char* what) const;

  std::filesystem::path path_, part_;
  VideoOptions options_;
  Ticks ticks_;
  av::Output output_;
  av::Codec codec_;
  av::Scaler rgb_to_yuv_;
  av::Frame yuv_;
  av::Packet packet_;
  int frames_ = 0;
  bool finished_ = false;
};

}  // namespace evac
