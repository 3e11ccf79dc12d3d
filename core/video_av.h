#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/error.h>
#include <libavutil/log.h>
#include <libswscale/swscale.h>
}

#include <array>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "core/error.h"

/// libav's objects, owned. Included by core/video_writer.cpp and core/video_reader.cpp only.
namespace evac::av {

template <auto kFree>
struct FreeThrough {  ///< for `void f(T**)`, libav's usual way
  template <typename T>
  void operator()(T* object) const {
    kFree(&object);
  }
};

struct FreeOutput {
  void operator()(AVFormatContext* output) const {
    avio_closep(&output->pb);
    avformat_free_context(output);
  }
};

struct FreeScaler {
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

using Codec = std::unique_ptr<AVCodecContext, FreeThrough<&avcodec_free_context>>;
using Frame = std::unique_ptr<AVFrame, FreeThrough<&av_frame_free>>;
using Input = std::unique_ptr<AVFormatContext, FreeThrough<&avformat_close_input>>;
using Output = std::unique_ptr<AVFormatContext, FreeOutput>;
using Packet = std::unique_ptr<AVPacket, FreeThrough<&av_packet_free>>;
using Scaler = std::unique_ptr<SwsContext, FreeScaler>;

inline std::string Reason(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

/// What goes wrong becomes an Error with the file's name; libav need not also print it.
inline void Silence() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_level(AV_LOG_QUIET); });
}

/// With rows padded as libav's fast paths want them.
inline Frame NewFrame(AVPixelFormat format, int width_px, int height_px) {
  Frame frame(av_frame_alloc());
  frame->format = format;
  frame->width = width_px;
  frame->height = height_px;
  if (av_frame_get_buffer(frame.get(), 0) < 0) throw InternalError("no memory for a {}x{} frame", width_px, height_px);
  return frame;
}

/// "file:…", so that no part of a path is taken for a protocol.
inline std::string Url(const std::filesystem::path& path) { return "file:" + path.string(); }

}  // namespace evac::av
