#include "core/video_encoder.h"

#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

void Check(const VideoOptions& options, const fs::path& path) {
  if (!(options.period_s >= 1e-3 && options.period_s <= 1e3)) {
    throw InvalidInput("{}: the video's period is {} s, wanted .001 … 1000", path.string(), options.period_s);
  }
  if (options.crf < 0 || options.crf > 51)
    throw InvalidInput("{}: the video's crf is {}, wanted 0 … 51", path.string(), options.crf);
  if (options.scale < 1 || options.scale > 64) {
    throw InvalidInput("{}: the video's scale is {}, wanted 1 … 64", path.string(), options.scale);
  }
}

/// Enlarged, and with even sides, as yuv420p needs them.
cv::Mat Prepared(const cv::Mat& rgb, int scale) {
  cv::Mat large = rgb;
  if (scale > 1) cv::resize(rgb, large, {}, scale, scale, cv::INTER_NEAREST);
  if (large.cols % 2 == 0 && large.rows % 2 == 0) return large;
  cv::Mat even;
  cv::copyMakeBorder(large, even, 0, large.rows % 2, 0, large.cols % 2, cv::BORDER_REPLICATE);
  return even;
}

av::Scaler NewRgbToYuv(int width_px, int height_px) {
  const int flags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INP;
  av::Scaler scaler(sws_getContext(width_px, height_px, AV_PIX_FMT_RGB24, width_px, height_px, AV_PIX_FMT_YUV420P,
                                   flags, nullptr, nullptr, nullptr));
  if (!scaler) throw InternalError("there is no conversion from RGB to yuv420p for {}x{}", width_px, height_px);
  const int* bt709 = sws_getCoefficients(SWS_CS_ITU709);
  sws_setColorspaceDetails(scaler.get(), bt709, 1, bt709, 0, 0, 1 << 16, 1 << 16);
  return scaler;
}

}  // namespace

/// Exact for every period that is a fraction with a denominator below a million, and never coarser than a millisecond.
VideoEncoder::Ticks VideoEncoder::TicksFor(double period_s) {
  const AVRational period = av_d2q(period_s, 1'000'000);
  const int finer = (1000 + period.den - 1) / period.den;
  return {period.den * finer, period.num * finer};
}

VideoEncoder::VideoEncoder(fs::path path, const VideoOptions& options)
    : path_(std::move(path)), part_(path_.string() + ".tmp"), options_(options) {
  av::Silence();
  Check(options_, path_);
  ticks_ = TicksFor(options_.period_s);
  AVFormatContext* output = nullptr;
  Demand(avformat_alloc_output_context2(&output, nullptr, "mp4", av::Url(part_).c_str()), "there is no mp4 format");
  output_.reset(output);
  output_->flags |= AVFMT_FLAG_BITEXACT;
  packet_.reset(av_packet_alloc());
  if (!avcodec_find_encoder_by_name("libx264"))
    throw InternalError("{}: libav has no H.264 encoder (libx264)", path_.string());
  Demand(avio_open(&output_->pb, av::Url(part_).c_str(), AVIO_FLAG_WRITE), "cannot be written");
}

VideoEncoder::~VideoEncoder() {
  if (finished_) return;
  output_.reset();
  std::error_code ignored;
  fs::remove(part_, ignored);
}

void VideoEncoder::Demand(int code, const char* what) const {
  if (code < 0) throw InternalError("{}: {}: {}", path_.string(), what, av::Reason(code));
}

void VideoEncoder::SetUpCodec(int width_px, int height_px) {
  const AVCodec* h264 = avcodec_find_encoder_by_name("libx264");
  codec_.reset(avcodec_alloc_context3(h264));
  codec_->width = width_px;
  codec_->height = height_px;
  codec_->pix_fmt = AV_PIX_FMT_YUV420P;
  codec_->time_base = {1, ticks_.per_s};
  codec_->framerate = {ticks_.per_s, ticks_.per_frame};
  codec_->color_range = AVCOL_RANGE_MPEG;
  codec_->colorspace = AVCOL_SPC_BT709;
  codec_->color_primaries = AVCOL_PRI_BT709;
  codec_->color_trc = AVCOL_TRC_BT709;
  codec_->gop_size = 25;     // raters scrub: no seek decodes more than this
  codec_->max_b_frames = 0;  // decoding order is time order, the first frame is at 0 without an edit list
  codec_->thread_count = 1;  // the same bytes on every machine, and lanes run beside each other anyway
  codec_->flags |= AV_CODEC_FLAG_BITEXACT | AV_CODEC_FLAG_GLOBAL_HEADER;
  AVDictionary* settings = nullptr;
  av_dict_set(&settings, "preset", options_.preset.c_str(), 0);
  av_dict_set_int(&settings, "crf", options_.crf, 0);
  av_dict_set(&settings, "x264-params", "cpu-independent=1", 0);
  const int opened = avcodec_open2(codec_.get(), h264, &settings);
  av_dict_free(&settings);
  Demand(opened, "the H.264 encoder does not start");
}

void VideoEncoder::WriteHeader() {
  AVStream* stream = avformat_new_stream(output_.get(), nullptr);
  stream->time_base = codec_->time_base;
  stream->avg_frame_rate = codec_->framerate;
  Demand(avcodec_parameters_from_context(stream->codecpar, codec_.get()), "the stream cannot be described");
  AVDictionary* settings = nullptr;
  av_dict_set(&settings, "movflags", "+faststart", 0);
  const int written = avformat_write_header(output_.get(), &settings);
  av_dict_free(&settings);
  Demand(written, "the header cannot be written");
}

void VideoEncoder::Start(int width_px, int height_px) {
  SetUpCodec(width_px, height_px);
  rgb_to_yuv_ = NewRgbToYuv(width_px, height_px);
  yuv_ = av::NewFrame(AV_PIX_FMT_YUV420P, width_px, height_px);
  WriteHeader();
}

void VideoEncoder::Append(const cv::Mat& rgb) {
  const cv::Mat image = Prepared(rgb, options_.scale);
  if (frames_ == 0) Start(image.cols, image.rows);
  Demand(av_frame_make_writable(yuv_.get()), "no memory for a frame");
  const std::uint8_t* rows[] = {image.data};
  const int strides[] = {static_cast<int>(image.step)};
  sws_scale(rgb_to_yuv_.get(), rows, strides, 0, image.rows, yuv_->data, yuv_->linesize);
  yuv_->pts = std::int64_t{frames_} * ticks_.per_frame;
  Encode(yuv_.get());
  ++frames_;
}

/// Gives the encoder a frame, or the end, and writes what it has ready.
void VideoEncoder::Encode(const AVFrame* frame_or_end) {
  Demand(avcodec_send_frame(codec_.get(), frame_or_end), "a frame cannot be encoded");
  for (;;) {
    const int received = avcodec_receive_packet(codec_.get(), packet_.get());
    if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
    Demand(received, "a frame cannot be encoded");
    packet_->duration = ticks_.per_frame;
    packet_->stream_index = 0;
    av_packet_rescale_ts(packet_.get(), codec_->time_base, output_->streams[0]->time_base);
    Demand(av_write_frame(output_.get(), packet_.get()), "a frame cannot be written");
    av_packet_unref(packet_.get());
    Demand(output_->pb->error, "a frame cannot be written");
  }
}

FinishedVideo VideoEncoder::Finish() {
  if (frames_ == 0) throw InternalError("{}: a video without frames", path_.string());
  Encode(nullptr);
  Demand(av_write_trailer(output_.get()), "the end of the file cannot be written");
  avio_flush(output_->pb);
  Demand(output_->pb->error, "the end of the file cannot be written");
  Demand(avio_closep(&output_->pb), "cannot be closed");
  const std::string sha256 = Sha256HexOfFile(part_);
  SyncAndRename(part_, path_);
  finished_ = true;
  return {path_, sha256, frames_};
}

}  // namespace evac
