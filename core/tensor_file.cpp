#include "core/tensor_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <iterator>
#include <utility>

#include "core/tensor_file_header.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "tensors are used as they lie in the file");

constexpr std::size_t kLengthBytes = 8;
constexpr std::size_t kMaxHeaderBytes = 100'000'000;

std::string SystemMessage(const fs::path& path, const char* doing) {
  return path.string() + ": cannot " + doing + ": " + std::strerror(errno);
}

TensorError SystemError(const fs::path& path, const char* doing) { return TensorError(SystemMessage(path, doing)); }

TensorWriteError WriteError(const fs::path& path, const char* doing) {
  return TensorWriteError(SystemMessage(path, doing));
}

/// Whether somebody named a place where no file can be, rather than the machine failing.
bool IsNoPlaceForAFile(int error) {
  constexpr int kWrongPaths[] = {ENOENT, ENOTDIR, EISDIR, ENOTEMPTY, EEXIST, EACCES, EPERM, EROFS, ENAMETOOLONG, ELOOP};
  return std::find(std::begin(kWrongPaths), std::end(kWrongPaths), error) != std::end(kWrongPaths);
}

[[noreturn]] void ThrowForPlace(const fs::path& path, const char* doing) {
  if (IsNoPlaceForAFile(errno)) throw SystemError(path, doing);
  throw WriteError(path, doing);
}

class Descriptor {
 public:
  explicit Descriptor(int file) : file_(file) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (file_ >= 0) ::close(file_);
  }
  int get() const { return file_; }

 private:
  int file_;
};

std::size_t ClaimedBytes(const HeaderEntry& entry, const std::string& file) {
  try {
    return entry.ByteCount();
  } catch (const TensorError& error) {
    throw TensorError(file + ": " + error.what());
  }
}

fs::path FolderOf(const fs::path& path) { return path.parent_path().empty() ? fs::path(".") : path.parent_path(); }

void SyncFolderOf(const fs::path& path) {
  const fs::path folder = FolderOf(path);
  const Descriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.get() < 0 || ::fsync(file.get()) != 0) throw WriteError(folder, "sync");
}

/// Where the bytes go: what would be renamed to a link's own name would take its place, as it would a device's.
fs::path Followed(fs::path path) {
  std::error_code error;
  const fs::file_status there = fs::status(path, error);
  if (fs::exists(there) && !fs::is_regular_file(there))
    throw TensorError(path.string() + ": is no regular file, wanted one, or a name that is free");
  for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(path, error)); ++links)  // in a circle: as it is
    path = FolderOf(path) / fs::read_symlink(path, error);
  return path;
}

/// What a file is called until it is whole; the number of the process follows.
std::string PartialName(const fs::path& path) { return path.filename().string() + ".partial-"; }

/// Whether that is the number of a process, and there is no such process.
bool IsOfADeadProcess(std::string_view number) {
  pid_t process = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), process);
  const bool is_number = error == std::errc() && end == number.data() + number.size() && process > 0;
  return is_number && ::kill(process, 0) != 0 && errno == ESRCH;
}

/// Those who were killed while they wrote `path` left what they had.
void RemovePartsOfTheDead(const fs::path& path) {
  const std::string begin = PartialName(path);
  std::error_code error, ignored;
  for (fs::directory_iterator file(FolderOf(path), error), end; !error && file != end; file.increment(error)) {
    const std::string name = file->path().filename().string();
    if (name.starts_with(begin) && IsOfADeadProcess(std::string_view(name).substr(begin.size())))
      fs::remove(file->path(), ignored);
  }
}

}  // namespace

void TensorFile::Map(const fs::path& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) throw SystemError(path, "open");
  if (!S_ISREG(status.st_mode)) throw TensorError(path.string() + ": no regular file");
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size < kLengthBytes) throw TensorError(path.string() + ": cut off within the safetensors header");
  void* mapping = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
  if (mapping == MAP_FAILED) throw SystemError(path, "map");
  name_ = path.string();
  mapping_ = mapping;
  bytes_ = {static_cast<const std::byte*>(mapping), size};
}

void TensorFile::Own(std::string bytes, const std::string& name) {
  name_ = name;
  owned_ = std::make_unique<std::string>(std::move(bytes));
  bytes_ = std::as_bytes(std::span(*owned_));
}

TensorFile TensorFile::Open(const fs::path& path) {
  TensorFile tensors;
  tensors.Map(path);
  tensors.ReadHeader();
  return tensors;
}

TensorFile TensorFile::Parse(std::string bytes, const std::string& name) {
  TensorFile tensors;
  tensors.Own(std::move(bytes), name);
  tensors.ReadHeader();
  return tensors;
}

TensorFile::TensorFile(TensorFile&& other) noexcept { *this = std::move(other); }

TensorFile& TensorFile::operator=(TensorFile&& other) noexcept {
  if (this == &other) return *this;
  Unmap();
  name_ = std::move(other.name_);
  owned_ = std::move(other.owned_);
  repacked_ = std::move(other.repacked_);
  bytes_ = std::exchange(other.bytes_, {});
  mapping_ = std::exchange(other.mapping_, nullptr);
  metadata_ = std::move(other.metadata_);
  tensors_ = std::move(other.tensors_);
  by_name_ = std::move(other.by_name_);
  return *this;
}

TensorFile::~TensorFile() { Unmap(); }

void TensorFile::Unmap() {
  if (mapping_ != nullptr) ::munmap(mapping_, bytes_.size());
  mapping_ = nullptr;
}

void TensorFile::ReadHeader() {
  if (bytes_.size() < kLengthBytes) throw TensorError(name_ + ": cut off within the safetensors header");
  std::uint64_t length = 0;
  std::memcpy(&length, bytes_.data(), kLengthBytes);
  if (length > kMaxHeaderBytes || length > bytes_.size() - kLengthBytes) {
    throw TensorError(name_ + ": the safetensors header claims " + std::to_string(length) + " bytes, the file has " +
                      std::to_string(bytes_.size()) + " and a header at most " + std::to_string(kMaxHeaderBytes));
  }
  const auto* text = reinterpret_cast<const char*>(bytes_.data() + kLengthBytes);
  TensorHeader header = ParseTensorHeader({text, static_cast<std::size_t>(length)}, name_);
  metadata_ = std::move(header.metadata);
  std::stable_sort(header.entries.begin(), header.entries.end(), [](const HeaderEntry& a, const HeaderEntry& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  const std::span<const std::byte> data = bytes_.subspan(kLengthBytes + static_cast<std::size_t>(length));
  std::size_t at = 0;
  for (HeaderEntry& entry : header.entries) {
    if (entry.begin != at || entry.end < entry.begin || entry.end > data.size() ||
        entry.end - entry.begin != ClaimedBytes(entry, name_)) {
      throw TensorError(name_ + ": tensor '" + entry.name + "' claims bytes " + std::to_string(entry.begin) + " to " +
                        std::to_string(entry.end) + ", wanted " + std::to_string(ClaimedBytes(entry, name_)) +
                        " bytes from byte " + std::to_string(at) + " of " + std::to_string(data.size()));
    }
    at = entry.end;
    by_name_.emplace(entry.name, tensors_.size());
    const std::span<const std::byte> bytes = data.subspan(entry.begin, entry.end - entry.begin);
    tensors_.push_back({static_cast<TensorDeclaration&&>(entry), bytes});
  }
  if (at != data.size())
    throw TensorError(name_ + ": " + std::to_string(data.size() - at) + " bytes after the last tensor belong to none");
}

const TensorView& TensorFile::Get(const std::string& tensor) const {
  const auto found = by_name_.find(tensor);
  if (found == by_name_.end()) throw TensorError(name_ + ": there is no tensor '" + tensor + "'");
  return tensors_[found->second];
}

void TensorFile::LetGo(const TensorView& tensor) const {
  const std::byte* first_byte = tensor.bytes.data();
  if (mapping_ == nullptr || first_byte < bytes_.data() || first_byte >= bytes_.data() + bytes_.size()) return;
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  const auto offset = static_cast<std::size_t>(tensor.bytes.data() - bytes_.data());
  const std::size_t first = (offset + page - 1) / page * page, last = (offset + tensor.bytes.size()) / page * page;
  if (first < last) ::madvise(static_cast<std::byte*>(mapping_) + first, last - first, MADV_DONTNEED);
}

TensorFileWriter::TensorFileWriter(const fs::path& path, std::span<const TensorDeclaration> tensors,
                                   const TensorMetadata& metadata)
    : path_(Followed(path)), partial_(path_.parent_path() / (PartialName(path_) + std::to_string(::getpid()))) {
  RemovePartsOfTheDead(path_);
  const std::string header = TensorHeaderText(tensors, metadata);
  if (header.size() > kMaxHeaderBytes) throw TensorError(path.string() + ": a header beyond 100 MB");
  file_ = ::open(partial_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file_ < 0) ThrowForPlace(partial_, "write");
  const std::uint64_t length = header.size();
  try {
    Write(&length, sizeof length);
    Write(header.data(), header.size());
  } catch (const TensorError&) {  // what is not constructed is not destroyed either
    ::close(file_);
    ::unlink(partial_.c_str());
    throw;
  }
  for (const TensorDeclaration& tensor : tensors) missing_ += tensor.ByteCount();
}

TensorFileWriter::~TensorFileWriter() {
  if (file_ < 0) return;
  ::close(file_);
  ::unlink(partial_.c_str());
}

void TensorFileWriter::Append(std::span<const std::byte> bytes) {
  if (bytes.size() > missing_) throw TensorError(path_.string() + ": more bytes than were declared");
  Write(bytes.data(), bytes.size());
  missing_ -= bytes.size();
}

void TensorFileWriter::Write(const void* bytes, std::size_t count) {
  const char* at = static_cast<const char*>(bytes);
  while (count > 0) {
    const ssize_t written = ::write(file_, at, std::min<std::size_t>(count, 1u << 30));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw WriteError(partial_, "write");
    at += written;
    count -= static_cast<std::size_t>(written);
  }
}

void TensorFileWriter::Finish() {
  if (missing_ > 0) throw TensorError(path_.string() + ": " + std::to_string(missing_) + " declared bytes are missing");
  if (::fsync(file_) != 0) throw WriteError(partial_, "sync");
  ::close(std::exchange(file_, -1));
  if (::rename(partial_.c_str(), path_.c_str()) != 0) {
    const int why = errno;
    ::unlink(partial_.c_str());
    errno = why;
    ThrowForPlace(path_, "rename to");
  }
  SyncFolderOf(path_);
}

void WriteTensorFile(const fs::path& path, std::span<const TensorView> tensors, const TensorMetadata& metadata) {
  const std::vector<TensorDeclaration> declarations(tensors.begin(), tensors.end());
  TensorFileWriter writer(path, declarations, metadata);
  for (const TensorView& tensor : tensors) {
    if (tensor.bytes.size() != tensor.ByteCount())
      throw TensorError("tensor '" + tensor.name + "': its bytes do not fill its shape");
    writer.Append(tensor.bytes);
  }
  writer.Finish();
}

}  // namespace evac
