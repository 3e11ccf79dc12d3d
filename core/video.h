#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace evac {

/// libx264's, from fastest to smallest.
inline constexpr const char* kVideoPresets[] = {"ultrafast", "superfast", "veryfast", "faster", "fast",
                                                "medium",    "slow",      "slower",   "veryslow"};

inline constexpr int kLongestVideoSide_px = 16384;  ///< libx264's, scaled

struct VideoOptions {
  double period_s = 0.1;  ///< presentation time of frame k is k * period_s exactly (time base 1/1000 s or finer)
  int crf = 20;           ///< H.264 quality, 0 lossless … 51
  std::string preset = "veryfast";  ///< one of kVideoPresets
  int scale = 1;  ///< each pixel becomes scale x scale (nearest), so that small frames are legible in a player
};

struct FinishedVideo {
  std::filesystem::path path;
  std::string sha256;  ///< of the file's bytes
  int frames = 0;
};

/// Encodes frames as they come, in a thread of its own: H.264, yuv420p, faststart mp4, playable in a browser. The codec
/// has one thread and the file no clock: the same frames give the same bytes. Until Finish the file is `path`.tmp;
/// destroyed before that, it is removed.
class VideoWriter {
 public:
  /// @throws Error if the folder cannot be written or there is no H.264 encoder.
  VideoWriter(std::filesystem::path path, const VideoOptions& options);
  ~VideoWriter();
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) noexcept;

  /// @param rgb  CV_8UC3 RGB. The first frame fixes the size; an odd side is padded by repeating its last row or
  /// column.
  /// Copied and queued: returns at once unless the encoder is far behind.
  /// @throws Error if the size differs, or for an earlier frame that could not be written (the disk is full).
  void Append(const cv::Mat& rgb);

  /// Writes the trailer, syncs the file, renames it to its final name and syncs the folder. Call once, after at least
  /// one frame.
  FinishedVideo Finish();

 private:
  class Background;
  std::unique_ptr<Background> background_;
};

/// Decodes a video front to back. Bytes come from outside: broken files end in an Error that names the file, and so do
/// those that a player would turn, mirror or stretch.
class VideoReader {
 public:
  explicit VideoReader(const std::filesystem::path& path);
  ~VideoReader();

  /// The next frame as CV_8UC3 RGB in a Mat of its own, or an empty Mat at the end.
  cv::Mat Next();
  /// Decodes the next frame without making a picture of it, which costs more than decoding. False at the end.
  bool Skip();
  /// How many frames the file says it has; where it says nothing, 0. One that has fewer is an Error at its end.
  int frames() const;
  /// Seconds between two frames on average, as the file says; where it says nothing, 0.
  double mean_period_s() const;
  /// Presentation time of the frame last returned, seconds.
  double time_s() const;
  int width_px() const;
  int height_px() const;

 private:
  struct Decoder;
  std::unique_ptr<Decoder> decoder_;
};

/// "libavcodec 59.37.100", for `evac doctor`.
std::string VideoLibrary();

/// Every frame of a short video.
std::vector<cv::Mat> ReadAllFrames(const std::filesystem::path& path);

/// The views of one observation side by side, heights made equal by padding below: how an episode's video and thumbnail
/// show them.
cv::Mat SideBySide(const std::vector<cv::Mat>& images);

}  // namespace evac
