#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <vector>

#include "core/tensor_file.h"

/// How long until every page of a file of weights was touched, beside what reading it costs: weights_loading FILE…
/// Pieces of 64 MB take turns, touched as TensorFile maps them or read with `read`, because the rate of a shared disk
/// changes by the second; a second pass swaps the two. Before each pass the system forgets the file's pages.
namespace evac {
namespace {

constexpr std::size_t kPiece = 64 << 20, kPage = 4096;
using Clock = std::chrono::steady_clock;

struct Times {
  double touched_s = 0, read_s = 0;
};

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

void Touch(std::span<const std::byte> piece) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < piece.size(); i += kPage) sum += static_cast<unsigned>(piece[i]);
  const volatile unsigned used = sum;
  static_cast<void>(used);
}

void Read(int file, std::size_t at, std::span<std::byte> buffer) {
  while (!buffer.empty()) {
    const ssize_t count = ::pread(file, buffer.data(), buffer.size(), static_cast<off_t>(at));
    if (count <= 0) throw TensorError("a piece of the file cannot be read");
    at += static_cast<std::size_t>(count);
    buffer = buffer.subspan(static_cast<std::size_t>(count));
  }
}

void Pass(const char* path, bool touch_first, Times& times) {
  const int file = ::open(path, O_RDONLY | O_CLOEXEC);
  ::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
  const TensorFile tensors = TensorFile::OpenCheckpoint(path);
  std::vector<std::byte> buffer(kPiece);
  bool touch = touch_first;
  for (std::size_t at = 0; at < tensors.bytes().size(); at += kPiece, touch = !touch) {
    const std::span<const std::byte> piece = tensors.bytes().subspan(at, std::min(kPiece, tensors.bytes().size() - at));
    const Clock::time_point start = Clock::now();
    if (touch) {
      Touch(piece);
      times.touched_s += SecondsSince(start);
    } else {
      Read(file, at, std::span(buffer).first(piece.size()));
      times.read_s += SecondsSince(start);
    }
  }
  ::close(file);
}

void Measure(const char* path) {
  const Clock::time_point start = Clock::now();
  const std::size_t bytes = TensorFile::OpenCheckpoint(path).bytes().size();
  const double open_s = SecondsSince(start), megabytes = static_cast<double>(bytes) / 1e6;
  Times times;
  Pass(path, true, times);
  Pass(path, false, times);
  fmt::print(
      "{}: {:.2f} GB, opened in {:.3f} s, every page touched in {:.1f} s ({:.0f} MB/s), read in {:.1f} s ({:.0f} "
      "MB/s): {:.2f} of the disk's rate\n",
      path, megabytes / 1e3, open_s, times.touched_s, megabytes / times.touched_s, times.read_s,
      megabytes / times.read_s, times.read_s / times.touched_s);
}

}  // namespace
}  // namespace evac

int main(int argc, char** argv) try {
  if (argc < 2) return std::fputs("weights_loading FILE…: docs/performance.md\n", stderr), 2;
  for (int i = 1; i < argc; ++i) evac::Measure(argv[i]);
  return 0;
} catch (const std::exception& error) {
  std::fputs((std::string(error.what()) + "\n").c_str(), stderr);
  return 2;
}
