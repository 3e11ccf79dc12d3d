#pragma once

#include <sys/mount.h>

#include <filesystem>

namespace evac {

/// A small disk that fills up properly; gone with this.
class SmallDisk {
 public:
  /// @param options  of tmpfs: "size=1m"
  SmallDisk(const std::filesystem::path& at, const char* options) : at_(at) {
    std::filesystem::create_directories(at_);
    is_there_ = ::mount("tmpfs", at_.c_str(), "tmpfs", 0, options) == 0;
  }
  ~SmallDisk() {
    if (is_there_) ::umount2(at_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool is_there() const { return is_there_; }  ///< to mount one needs root
  bool Remount(unsigned long flags, const char* options) {
    return ::mount("tmpfs", at_.c_str(), "tmpfs", MS_REMOUNT | flags, options) == 0;
  }

 private:
  std::filesystem::path at_;
  bool is_there_;
};

}  // namespace evac
