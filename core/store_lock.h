#pragma once

#include <filesystem>

namespace evac {

/// FOLDER/lock, held by the one process that may write the folder: a run, a collection, shards. The kernel releases it with the process, however that
/// ends.
class RunLock {
 public:
  /// @throws InvalidInput naming the holder's process number, if there is one; or the file, if it is somebody's: holds
  /// anything but a process's number, or is a link.
  explicit RunLock(const std::filesystem::path& file);
  ~RunLock();
  RunLock(const RunLock&) = delete;
  RunLock& operator=(const RunLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace evac
