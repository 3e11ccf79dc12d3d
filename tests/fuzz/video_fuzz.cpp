#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/video.h"

/// Any bytes are frames of the size the reader states, or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int descriptor = ::memfd_create("video_fuzz", MFD_CLOEXEC);
  if (descriptor < 0 || ::write(descriptor, data, size) != static_cast<ssize_t>(size)) std::abort();
  try {
    evac::VideoReader reader("/proc/self/fd/" + std::to_string(descriptor));
    cv::Mat frame = reader.Next();
    for (int frames = 1; !frame.empty() && frames < 100; ++frames) {
      if (frame.type() != CV_8UC3 || frame.cols != reader.width_px() || frame.rows != reader.height_px()) std::abort();
      frame = reader.Next();
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  ::close(descriptor);
  return 0;
}
