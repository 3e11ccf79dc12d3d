#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

#include "core/error.h"
#include "core/video.h"
#include "core/video_av.h"

namespace evac {
namespace {

constexpr std::int64_t kMaxPixels = 1 << 25;  // 8K; a broken header must not ask for all memory

/// The old "J" formats are the plain ones with full range.
AVPixelFormat WithoutJ(AVPixelFormat format, bool& full_range) {
  constexpr std::pair<AVPixelFormat, AVPixelFormat> kPlain[] = {{AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUV420P},
                                                                {AV_PIX_FMT_YUVJ422P, AV_PIX_FMT_YUV422P},
                                                                {AV_PIX_FMT_YUVJ444P, AV_PIX_FMT_YUV444P},
                                                                {AV_PIX_FMT_YUVJ440P, AV_PIX_FMT_YUV440P}};
  for (const auto& [old, plain] : kPlain) {
    if (format != old) continue;
    full_range = true;
    return plain;
  }
  return format;
}

/// As the file says; where it is silent, as players guess: BT.709 from 720 rows on, BT.601 below.
const int* YuvCoefficients(const AVFrame& frame) {
  if (frame.colorspace == AVCOL_SPC_UNSPECIFIED || frame.colorspace == AVCOL_SPC_RGB) {
    return sws_getCoefficients(frame.height >= 720 ? SWS_CS_ITU709 : SWS_CS_ITU601);
  }
  return sws_getCoefficients(frame.colorspace);
}

av::Scaler NewToRgb(const AVFrame& frame) {
  bool full_range = frame.color_range == AVCOL_RANGE_JPEG;
  const AVPixelFormat format = WithoutJ(static_cast<AVPixelFormat>(frame.format), full_range);
  const int flags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INT;
  av::Scaler scaler(sws_getContext(frame.width, frame.height, format, frame.width, frame.height, AV_PIX_FMT_RGB24,
                                   flags, nullptr, nullptr, nullptr));
  if (!scaler) return scaler;
  const int* coefficients = YuvCoefficients(frame);
  sws_setColorspaceDetails(scaler.get(), coefficients, full_range ? 1 : 0, coefficients, 1, 0, 1 << 16, 1 << 16);
  return scaler;
}

/// Whether a player turns, mirrors or stretches what is stored. Where on the screen it puts it (6 and 7) is no matter.
bool IsTurned(const AVStream& stream) {
  std::array<std::int32_t, 9> matrix{};
  std::size_t bytes = 0;
  const std::uint8_t* found = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &bytes);
  if (!found || bytes < sizeof matrix) return false;
  std::memcpy(matrix.data(), found, sizeof matrix);
  matrix[6] = matrix[7] = 0;
  return matrix != std::array<std::int32_t, 9>{1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30};  // 16.16, 2.30 fixed point
}

}  // namespace

struct VideoReader::Decoder {
  explicit Decoder(const std::filesystem::path& path);

  bool Decode();

  void OpenFile();
  void DemandUpright() const;
  void OpenCodec();
  bool Feed();
  cv::Mat Rgb();
  void Demand(int code, const char* what) const;

  std::string name_;
  av::Input input_;
  av::Codec codec_;
  av::Scaler to_rgb_;
  av::Packet packet_;
  av::Frame frame_;
  int stream_ = -1;
  av::Frame rgb_;                 ///< rows padded as swscale wants them; its size is the first frame's
  int format_ = AV_PIX_FMT_NONE;  ///< of the first frame; a video that changes it is broken
  std::int64_t packets_ = 0, frames_ = 0;
  double time_s_ = 0;
};

VideoReader::Decoder::Decoder(const std::filesystem::path& path) : name_(path.string()) {
  av::Silence();
  packet_.reset(av_packet_alloc());
  frame_.reset(av_frame_alloc());
  OpenFile();
  OpenCodec();
}

void VideoReader::Decoder::Demand(int code, const char* what) const {
  if (code < 0) throw InvalidInput("{}: {}: {}", name_, what, av::Reason(code));
}

void VideoReader::Decoder::OpenFile() {
  AVDictionary* settings = nullptr;
  av_dict_set(&settings, "protocol_whitelist", "file", 0);
  av_dict_set(&settings, "format_whitelist", "mov,matroska,avi", 0);  // containers; no play lists that name other files
  AVFormatContext* input = nullptr;
  const int opened = avformat_open_input(&input, av::Url(name_).c_str(), nullptr, &settings);
  av_dict_free(&settings);
  Demand(opened, "cannot be read as a video");
  input_.reset(input);
  Demand(avformat_find_stream_info(input, nullptr), "cannot be read as a video");
  stream_ = av_find_best_stream(input, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  Demand(stream_, "has no video stream");
  DemandUpright();
}

/// Frames are read as they are stored, and a camera's page is of what people were shown, or of that: nobody can tell.
void VideoReader::Decoder::DemandUpright() const {
  AVStream* stream = input_->streams[stream_];
  if (IsTurned(*stream))
    throw InvalidInput("{}: it says that it is to be turned or mirrored when shown, wanted one that is stored upright: "
                       "encode it again (ffmpeg does so by itself)", name_);
  const AVRational pixel = av_guess_sample_aspect_ratio(input_.get(), stream, nullptr);
  if (pixel.num > 0 && pixel.num != pixel.den)
    throw InvalidInput("{}: its pixels are {}:{}, wanted square ones: encode it again, and take a camera's page of that "
                       "size (ffmpeg -vf scale=iw*sar:ih,setsar=1)", name_, pixel.num, pixel.den);
}

void VideoReader::Decoder::OpenCodec() {
  const AVCodecParameters& parameters = *input_->streams[stream_]->codecpar;
  const AVCodec* codec = avcodec_find_decoder(parameters.codec_id);
  if (!codec) throw InvalidInput("{}: there is no decoder for {}", name_, avcodec_get_name(parameters.codec_id));
  codec_.reset(avcodec_alloc_context3(codec));
  Demand(avcodec_parameters_to_context(codec_.get(), &parameters), "the stream's description is broken");
  codec_->thread_count = 1;
  codec_->max_pixels = kMaxPixels;
  codec_->err_recognition = AV_EF_EXPLODE;  // a damaged frame is an error, not grey blocks that someone rates
  Demand(avcodec_open2(codec_.get(), codec, nullptr), "the decoder does not start");
  if (codec_->width <= 0 || codec_->height <= 0 || std::int64_t{codec_->width} * codec_->height > kMaxPixels) {
    throw InvalidInput("{}: a video of {}x{} pixels", name_, codec_->width, codec_->height);
  }
}

/// Gives the decoder its next packet; false at the end of the file.
bool VideoReader::Decoder::Feed() {
  for (;;) {
    const int read = av_read_frame(input_.get(), packet_.get());
    if (read == AVERROR_EOF) break;
    Demand(read, "cannot be read on");
    const bool is_ours = packet_->stream_index == stream_;
    const bool is_cut = packet_->flags & AV_PKT_FLAG_CORRUPT;
    const int sent = is_ours && !is_cut ? avcodec_send_packet(codec_.get(), packet_.get()) : 0;
    av_packet_unref(packet_.get());
    if (!is_ours) continue;
    ++packets_;
    Demand(is_cut ? AVERROR_INVALIDDATA : sent, "a frame is damaged");
    return true;
  }
  const int promised = avformat_index_get_entries_count(input_->streams[stream_]);
  if (packets_ < promised) throw InvalidInput("{}: the file ends after {} of {} frames", name_, packets_, promised);
  avcodec_send_packet(codec_.get(), nullptr);
  return false;
}

/// The next frame into frame_; false at the end.
bool VideoReader::Decoder::Decode() {
  for (;;) {
    const int received = avcodec_receive_frame(codec_.get(), frame_.get());
    if (received == AVERROR_EOF && frames_ == 0) throw InvalidInput("{}: has no frames", name_);
    if (received == AVERROR_EOF) return false;
    if (received != AVERROR(EAGAIN)) {
      Demand(received, "a frame is damaged");
      ++frames_;
      return true;
    }
    Feed();
  }
}

cv::Mat VideoReader::Decoder::Rgb() {
  const AVFrame& frame = *frame_;
  if (!to_rgb_) {
    to_rgb_ = NewToRgb(frame);
    if (!to_rgb_) throw InvalidInput("{}: a pixel format that cannot be shown as RGB", name_);
    rgb_ = av::NewFrame(AV_PIX_FMT_RGB24, frame.width, frame.height);
    format_ = frame.format;
  }
  if (frame.format != format_ || frame.width != rgb_->width || frame.height != rgb_->height) {
    throw InvalidInput("{}: the frames change their size or format on the way", name_);
  }
  sws_scale(to_rgb_.get(), frame.data, frame.linesize, 0, frame.height, rgb_->data, rgb_->linesize);
  if (frame.best_effort_timestamp != AV_NOPTS_VALUE) {
    const AVRational unit_s = input_->streams[stream_]->time_base;
    time_s_ = static_cast<double>(frame.best_effort_timestamp) * unit_s.num / unit_s.den;
  }
  return cv::Mat(rgb_->height, rgb_->width, CV_8UC3, rgb_->data[0], static_cast<std::size_t>(rgb_->linesize[0]))
      .clone();
}

VideoReader::VideoReader(const std::filesystem::path& path) : decoder_(std::make_unique<Decoder>(path)) {}
VideoReader::~VideoReader() = default;

cv::Mat VideoReader::Next() { return decoder_->Decode() ? decoder_->Rgb() : cv::Mat(); }
bool VideoReader::Skip() { return decoder_->Decode(); }
int VideoReader::frames() const {
  return avformat_index_get_entries_count(decoder_->input_->streams[decoder_->stream_]);
}
double VideoReader::mean_period_s() const {
  const AVRational rate_hz = decoder_->input_->streams[decoder_->stream_]->avg_frame_rate;
  return rate_hz.num > 0 && rate_hz.den > 0 ? static_cast<double>(rate_hz.den) / rate_hz.num : 0;
}
double VideoReader::time_s() const { return decoder_->time_s_; }
int VideoReader::width_px() const { return decoder_->rgb_ ? decoder_->rgb_->width : decoder_->codec_->width; }
int VideoReader::height_px() const { return decoder_->rgb_ ? decoder_->rgb_->height : decoder_->codec_->height; }

std::string VideoLibrary() {
  const unsigned version = avcodec_version();
  return fmt::format("libavcodec {}.{}.{}", AV_VERSION_MAJOR(version), AV_VERSION_MINOR(version), AV_VERSION_MICRO(version));
}

}  // namespace evac
