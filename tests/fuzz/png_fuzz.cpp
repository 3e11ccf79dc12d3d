#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/store_codec.h"

/// Any bytes are a picture that is kept exactly, or an Error.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const cv::Mat image = evac::codec::DecodePng({reinterpret_cast<const char*>(data), size});
    if (image.type() != CV_8UC3 || image.empty()) std::abort();
    if (cv::norm(evac::codec::DecodePng(evac::codec::EncodePng(image)), image, cv::NORM_INF) != 0) std::abort();
  } catch (const evac::Error&) {
  }
  return 0;
}
