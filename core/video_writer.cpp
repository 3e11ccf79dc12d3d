#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "core/error.h"
#include "core/video.h"
#include "core/video_encoder.h"

namespace evac {
namespace {

constexpr std::size_t kMostWaiting = 64;  ///< frames; whoever appends faster than they are encoded waits

}  // namespace

/// An encoder and the thread it works in, so that frames are encoded while the world makes the next ones.
class VideoWriter::Background {
 public:
  Background(std::filesystem::path path, const VideoOptions& options)
      : encoder_(std::move(path), options), thread_([this] { Work(); }) {}

  ~Background() { End(); }

  void Append(const cv::Mat& rgb) {
    CheckFrame(rgb);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return error_ || waiting_.size() < kMostWaiting; });
    if (error_) std::rethrow_exception(error_);
    waiting_.push_back(rgb.clone());
    changed_.notify_all();
  }

  FinishedVideo Finish() {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return error_ || (waiting_.empty() && !is_encoding_); });
    }
    End();
    if (error_) std::rethrow_exception(error_);
    return encoder_.Finish();
  }

 private:
  void CheckFrame(const cv::Mat& rgb) {
    const std::string path = encoder_.path().string();
    if (rgb.empty() || rgb.type() != CV_8UC3) throw InternalError("{}: a frame is no 8-bit RGB image", path);
    if (frames_++ == 0) size_px_ = rgb.size();
    if (rgb.size() == size_px_) return;
    throw InternalError("{}: frame {} is {}x{}, the first was {}x{}", path, frames_ - 1, rgb.cols, rgb.rows,
                        size_px_.width, size_px_.height);
  }

  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return is_ending_ || !waiting_.empty(); });
      if (is_ending_) return;
      const cv::Mat frame = std::exchange(waiting_.front(), {});
      waiting_.pop_front();
      is_encoding_ = true;
      lock.unlock();
      const std::exception_ptr error = Encode(frame);
      lock.lock();
      is_encoding_ = false;
      if (error) error_ = error;
      changed_.notify_all();
      if (error) return;
    }
  }

  std::exception_ptr Encode(const cv::Mat& frame) {
    try {
      encoder_.Append(frame);
      return nullptr;
    } catch (...) {
      return std::current_exception();
    }
  }

  /// What still waits is left; idempotent.
  void End() {
    {
      const std::lock_guard lock(mutex_);
      is_ending_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  int frames_ = 0;        ///< appended
  cv::Size size_px_;      ///< of the first
  VideoEncoder encoder_;  ///< the thread's while it runs
  std::mutex mutex_;      ///< guards all below but the thread
  std::condition_variable changed_;
  std::deque<cv::Mat> waiting_;
  bool is_encoding_ = false, is_ending_ = false;
  std::exception_ptr error_;  ///< of the frame that could not be encoded; nothing is encoded after it
  std::thread thread_;
};

VideoWriter::VideoWriter(std::filesystem::path path, const VideoOptions& options)
    : background_(std::make_unique<Background>(std::move(path), options)) {}
VideoWriter::~VideoWriter() = default;
VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;
VideoWriter& VideoWriter::operator=(VideoWriter&&) noexcept = default;

void VideoWriter::Append(const cv::Mat& rgb) { background_->Append(rgb); }

FinishedVideo VideoWriter::Finish() {
  FinishedVideo video = background_->Finish();
  background_.reset();
  return video;
}

}  // namespace evac
