#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/recording_parts.h"
#include "tests/fuzz/scratch.h"

/// Any bytes are a recording's first picture of a size that is allowed, or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  scratch.Write("frame.png", data, size);
  try {
    const cv::Mat image = evac::ReadPng(scratch.folder() / "frame.png");
    if (image.type() != CV_8UC3 || image.empty() || image.cols > 8192 || image.rows > 8192) std::abort();
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
