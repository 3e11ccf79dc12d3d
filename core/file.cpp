#include "core/file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "core/error.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

void Sync(const fs::path& path, int flags) {
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC);
  const bool synced = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!synced) throw InternalError("{}: cannot be synced to disk: {}", path.string(), std::strerror(error));
}

void SyncFolder(const fs::path& folder) { Sync(folder.empty() ? fs::path(".") : folder, O_RDONLY | O_DIRECTORY); }

void RefuseAllButFiles(const fs::path& path) {
  const fs::file_status there = StatusOf(path);
  if (fs::is_directory(there)) throw InvalidInput("{}: is a folder, wanted a file", path.string());
  if (fs::exists(there) && !fs::is_regular_file(there))
    throw InvalidInput("{}: is no regular file, wanted one, or a name that is free", path.string());
}

/// Where the bytes go: what would be renamed to a link's own name would take its place.
fs::path Followed(fs::path path) {
  RefuseAllButFiles(path);  // and links in a circle
  while (fs::is_symlink(fs::symlink_status(path))) path = path.parent_path() / fs::read_symlink(path);
  return path;
}

/// What a file is called until it is whole.
fs::path PartOf(const fs::path& path) { return path.string() + ".tmp"; }

/// The part of a file, of this writer alone: others that write the same file wait until it has its final name.
class OwnPart {
 public:
  explicit OwnPart(const fs::path& whole) : whole_(whole), path_(PartOf(whole)) {
    while (!Take()) ::close(descriptor_);
  }
  ~OwnPart() { ::close(descriptor_); }
  OwnPart(const OwnPart&) = delete;
  OwnPart& operator=(const OwnPart&) = delete;

  /// Also over what a process left that was killed here.
  void Fill(std::string_view bytes) const {
    const auto size = static_cast<off_t>(bytes.size());
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno != EINTR) Fail();
      bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
    }
    if (::ftruncate(descriptor_, size) != 0) Fail();
  }

  const fs::path& path() const { return path_; }

 private:
  [[noreturn]] void Fail() const {
    throw InternalError("{}: cannot be written: {}", whole_.string(), std::strerror(errno));
  }

  /// @returns false if another writer renamed it while this one waited.
  bool Take() {
    descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) Fail();
    while (::flock(descriptor_, LOCK_EX) != 0 && errno == EINTR) {
    }
    struct stat mine = {}, there = {};
    ::fstat(descriptor_, &mine);
    return ::stat(path_.c_str(), &there) == 0 && mine.st_ino == there.st_ino && mine.st_dev == there.st_dev;
  }

  fs::path whole_, path_;
  int descriptor_ = -1;
};

}  // namespace

std::string ReadFile(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || fs::is_directory(path))
    throw InvalidInput("{}: cannot be read: {}", path.string(), std::strerror(file ? EISDIR : errno));
  std::string bytes;
  std::array<char, 1 << 16> piece;
  while (file.read(piece.data(), piece.size()), file.gcount() > 0)
    bytes.append(piece.data(), static_cast<std::size_t>(file.gcount()));
  if (file.bad()) throw InvalidInput("{}: cannot be read to its end: {}", path.string(), std::strerror(errno));
  return bytes;
}

void SyncAndRename(const fs::path& from, const fs::path& to) {
  Sync(from, O_RDONLY);
  if (::rename(from.c_str(), to.c_str()) != 0)
    throw InternalError("{}: cannot be renamed from {}: {}", to.string(), from.string(), std::strerror(errno));
  SyncFolder(to.parent_path());
}

fs::file_status StatusOf(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::none)
    throw InvalidInput("{}: cannot be looked at: {}", path.string(), error.message());
  return status;
}

void MakeFolders(const fs::path& folder) {
  if (folder.empty()) return;
  const fs::file_status there = StatusOf(folder);
  if (fs::is_directory(there)) return;
  if (fs::exists(there)) throw InvalidInput("{}: cannot be made: what is there is no folder", folder.string());
  MakeFolders(folder.parent_path());
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) throw InternalError("{}: cannot be made: {}", folder.string(), error.message());
  SyncFolder(folder.parent_path());
}

void RefuseFolder(const fs::path& file) {
  if (!file.has_filename()) throw InvalidInput("{}: is a folder, wanted a file", file.string());
  RefuseAllButFiles(file);
}

void WriteFileAtomically(const fs::path& wanted, std::string_view bytes) {
  const fs::path path = Followed(wanted);
  const OwnPart part(path);
  try {
    part.Fill(bytes);
    SyncAndRename(part.path(), path);
  } catch (const Error&) {
    std::error_code ignored;
    fs::remove(part.path(), ignored);
    throw;
  }
}

void LinkOrCopy(const fs::path& from, const fs::path& to) {
  std::error_code error, ignored;
  fs::create_hard_link(from, to, error);
  if (!error) return;
  const fs::path part = PartOf(to);
  fs::remove(part, ignored);  // of a process that was killed here
  try {
    if (!fs::copy_file(from, part, error))
      throw InternalError("{}: cannot be copied from {}: {}", to.string(), from.string(), error.message());
    SyncAndRename(part, to);
  } catch (const Error&) {
    fs::remove(part, ignored);
    throw;
  }
}

}  // namespace evac
