#include "core/store_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

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

}  // namespace

RunLock::RunLock(const std::filesystem::path& file)
    : descriptor_(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (descriptor_ < 0) throw InternalError("{}: cannot be opened: {}", file.string(), std::strerror(errno));
  if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    const std::string holder = Holder(descriptor_);
    ::close(descriptor_);
    if (error != EWOULDBLOCK) throw InternalError("{}: cannot be locked: {}", file.string(), std::strerror(error));
    throw InvalidInput("{}: {} is writing here; wait for it or stop it", file.parent_path().string(), holder);
  }
  const std::string number = std::to_string(::getpid()) + "\n";
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, number.data(), number.size(), 0) < 0) {
    // Only the message to a second process is poorer for it.
  }
}

RunLock::~RunLock() { ::close(descriptor_); }

}  // namespace evac
