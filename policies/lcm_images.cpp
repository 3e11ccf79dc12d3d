#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "policies/messages.h"

namespace evac {
namespace {

constexpr int kMaxSide_px = 4096;

void CheckImageHeader(const image_t& m) {
  const auto sane = [](int px) { return px >= 1 && px <= kMaxSide_px; };
  if (!sane(m.width_px) || !sane(m.height_px)) {
    throw InvalidInput("image of camera {}: size {}x{}, wanted 1 … {} pixels either way", m.camera, m.width_px,
                       m.height_px, kMaxSide_px);
  }
  if (m.encoding != image_t::RAW && m.encoding != image_t::JPEG) {
    throw InvalidInput("image of camera {}: encoding {}, wanted 0 (raw) or 1 (JPEG)", m.camera, m.encoding);
  }
}

/// Width and height as a JPEG's own header states them, so that no hostile size is ever decoded; {0, 0} if it has none.
cv::Size JpegSize(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 2 || bytes[0] != 0xFF || bytes[1] != 0xD8) return {0, 0};
  std::size_t at = 2;  // behind the start-of-image marker
  while (at + 9 <= bytes.size() && bytes[at] == 0xFF) {
    const int marker = bytes[at + 1];
    if (marker == 0xFF) {  // one that fills up
      ++at;
      continue;
    }
    if (marker < 0xC0 || (marker >= 0xD0 && marker <= 0xD9)) break;  // no length follows: in no header
    const bool is_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) return {bytes[at + 7] << 8 | bytes[at + 8], bytes[at + 5] << 8 | bytes[at + 6]};
    at += 2 + static_cast<std::size_t>(bytes[at + 2] << 8 | bytes[at + 3]);
  }
  return {0, 0};
}

cv::Mat DecodedJpeg(const image_t& m) {
  const cv::Size stated = JpegSize(m.data);
  if (stated.width != m.width_px || stated.height != m.height_px) {
    throw InvalidInput("image of camera {}: its JPEG says {}x{}, the message {}x{}", m.camera, stated.width,
                       stated.height, m.width_px, m.height_px);
  }
  cv::Mat bgr;
  try {
    bgr = cv::imdecode(m.data, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& error) {
    throw InvalidInput("image of camera {}: {} bytes that are no JPEG ({})", m.camera, m.data.size(), error.err);
  }
  if (bgr.empty()) throw InvalidInput("image of camera {}: {} bytes that are no JPEG", m.camera, m.data.size());
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return rgb;
}

}  // namespace

void PutImage(const cv::Mat& rgb, std::optional<int> jpeg_quality, image_t& message) {
  message.width_px = rgb.cols;
  message.height_px = rgb.rows;
  message.encoding = jpeg_quality ? image_t::JPEG : image_t::RAW;
  if (jpeg_quality) {
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    cv::imencode(".jpg", bgr, message.data, {cv::IMWRITE_JPEG_QUALITY, *jpeg_quality});
  } else {
    const cv::Mat packed = rgb.isContinuous() ? rgb : rgb.clone();
    message.data.assign(packed.data, packed.data + packed.total() * packed.elemSize());
  }
  message.num_bytes = static_cast<int>(message.data.size());
}

cv::Mat ImageOf(const image_t& m) {
  CheckImageHeader(m);
  if (m.encoding == image_t::JPEG) return DecodedJpeg(m);
  const std::size_t wanted = std::size_t{3} * m.width_px * m.height_px;
  if (m.data.size() != wanted) {
    throw InvalidInput("image of camera {}: {} bytes, wanted {} for {}x{} RGB", m.camera, m.data.size(), wanted,
                       m.width_px, m.height_px);
  }
  return cv::Mat(m.height_px, m.width_px, CV_8UC3, const_cast<std::uint8_t*>(m.data.data())).clone();
}

}  // namespace evac
