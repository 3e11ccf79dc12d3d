#include "core/store_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "core/error.h"

namespace evac {
namespace {

std::string Holder(int descriptor) {
  std::array<char, 16> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  const std::string number(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  return number.empty() ? "another process" : "process " + number.substr(0, number.find('\n'));
}

/// A lock is empty or holds the number of a process: what else is called so is somebody's, and locking would write over
/// it.
bool IsLock(int descriptor) {
  struct stat found = {};
  std::array<char, 17> text{};
  if (::fstat(descriptor, &found) != 0 || !S_ISREG(found.st_mode)) return false;
  const ssize_t size = ::pread(descriptor, text.data(), text.size(), 0);
  const auto belongs = [](char letter) { return letter == '\n' || (letter >= '0' && letter <= '9'); };
  return size >= 0 && size < std::ssize(text) && std::all_of(text.begin(), text.begin() + size, belongs);
}

int Open(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  const int error = errno;
  if (descriptor >= 0 && IsLock(descriptor)) return descriptor;
  if (descriptor >= 0) ::close(descriptor);
  if (descriptor >= 0 || error == ELOOP || error == EISDIR)
    throw InvalidInput("{}: is no lock of evac's, wanted that name free, or another folder", file.string());
  throw InternalError("{}: cannot be opened: {}", file.string(), std::strerror(error));
}

void Lock(int descriptor, const std::filesystem::path& file) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return;
  const int error = errno;
  const std::string holder = Holder(descriptor);
  ::close(descriptor);
  if (error != EWOULDBLOCK) throw InternalError("{}: cannot be locked: {}", file.string(), std::strerror(error));
  throw InvalidInput("{}: {} is writing here; wait for it or stop it", file.parent_path().string(), holder);
}

/// Whoever held it may have removed it before it was locked here.
bool IsThereStill(int descriptor, const std::filesystem::path& file) {
  struct stat mine = {}, there = {};
  return ::fstat(descriptor, &mine) == 0 && ::lstat(file.c_str(), &there) == 0 && mine.st_ino == there.st_ino &&
         mine.st_dev == there.st_dev;
}

}  // namespace

RunLock::RunLock(const std::filesystem::path& file) {
  for (bool is_mine = false; !is_mine;) {
    descriptor_ = Open(file);
    Lock(descriptor_, file);
    is_mine = IsThereStill(descriptor_, file);
    if (!is_mine) ::close(descriptor_);
  }
  const std::string number = std::to_string(::getpid()) + "\n";
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, number.data(), number.size(), 0) < 0) {
    // Only the message to a second process is poorer for it.
  }
}

RunLock::~RunLock() { ::close(descriptor_); }

}  // namespace evac
