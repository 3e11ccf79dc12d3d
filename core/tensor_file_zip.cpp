#include "core/tensor_file_zip.h"

#include <cstdint>
#include <cstring>
#include <optional>
#include <set>
#include <utility>

#include "core/tensor_file.h"

namespace evac {
namespace {

// Sections of "APPNOTE.TXT - .ZIP File Format Specification", 6.3.10, and where their fields lie.
constexpr std::uint32_t kLocal = 0x04034b50, kCentral = 0x02014b50, kEnd = 0x06054b50, kEnd64 = 0x06064b50,
                        kLocator64 = 0x07064b50;
constexpr std::size_t kLocalBytes = 30, kCentralBytes = 46, kEndBytes = 22, kEnd64Bytes = 56, kLocator64Bytes = 20;
constexpr std::size_t kMaxComment = 0xffff;
constexpr std::uint32_t kIn64 = 0xffffffff;

/// Where the list of files lies, and how long it is.
struct Directory {
  std::uint64_t entries = 0, bytes = 0, begin = 0;
};

struct Central {
  std::string name;
  std::uint64_t packed = 0, size = 0, local = 0;
  std::uint16_t flags = 0, method = 0;
};

class ZipReader {
 public:
  ZipReader(std::span<const std::byte> file, const std::string& name) : file_(file), name_(name) {}

  std::vector<ZipEntry> Read() {
    const Directory directory = FindDirectory();
    if (directory.begin > file_.size() || directory.bytes > file_.size() - directory.begin)
      throw Broken("its directory lies outside the file: it is cut off");
    std::vector<ZipEntry> entries;
    std::set<std::string> seen;
    std::size_t at = static_cast<std::size_t>(directory.begin);
    const std::size_t end = at + static_cast<std::size_t>(directory.bytes);
    for (std::uint64_t i = 0; i < directory.entries; ++i) {
      const Central central = ReadCentral(at, end);
      if (!seen.insert(central.name).second) throw Broken("'" + central.name + "' is there twice");
      entries.push_back({central.name, BytesOf(central)});
    }
    return entries;
  }

 private:
  TensorError Broken(const std::string& what) const { return TensorError(name_ + ": zip: " + what); }

  template <typename T>
  T At(std::size_t at) const {
    T value{};
    if (at > file_.size() || sizeof value > file_.size() - at) throw Broken("cut off");
    std::memcpy(&value, file_.data() + at, sizeof value);
    return value;
  }
  std::string TextAt(std::size_t at, std::size_t length) const {
    if (at > file_.size() || length > file_.size() - at) throw Broken("cut off");
    return {reinterpret_cast<const char*>(file_.data()) + at, length};
  }

  /// From the end: a comment may follow the last section.
  Directory FindDirectory() const {
    for (std::size_t comment = 0; comment <= kMaxComment && comment + kEndBytes <= file_.size(); ++comment) {
      const std::size_t end = file_.size() - kEndBytes - comment;
      if (At<std::uint32_t>(end) == kEnd && At<std::uint16_t>(end + 20) == comment) return ReadEnd(end);
    }
    throw Broken("no directory at the end: no zip, or cut off");
  }
  Directory ReadEnd(std::size_t end) const {
    if (end >= kLocator64Bytes && At<std::uint32_t>(end - kLocator64Bytes) == kLocator64) {
      const auto end64 = At<std::uint64_t>(end - kLocator64Bytes + 8);
      if (end64 > file_.size() - kEnd64Bytes || At<std::uint32_t>(end64) != kEnd64)
        throw Broken("its 64-bit directory is not where it claims to be");
      return {At<std::uint64_t>(end64 + 32), At<std::uint64_t>(end64 + 40), At<std::uint64_t>(end64 + 48)};
    }
    if (At<std::uint16_t>(end + 4) != 0 || At<std::uint16_t>(end + 6) != 0) throw Broken("is in several parts");
    return {At<std::uint16_t>(end + 10), At<std::uint32_t>(end + 12), At<std::uint32_t>(end + 16)};
  }

  Central ReadCentral(std::size_t& at, std::size_t end) const {
    if (at + kCentralBytes > end || At<std::uint32_t>(at) != kCentral) throw Broken("its directory is cut off");
    const std::size_t name = At<std::uint16_t>(at + 28), extra = At<std::uint16_t>(at + 30),
                      comment = At<std::uint16_t>(at + 32);
    if (name + extra + comment > end - at - kCentralBytes) throw Broken("its directory is cut off");
    Central central{TextAt(at + kCentralBytes, name), At<std::uint32_t>(at + 20), At<std::uint32_t>(at + 24),
                    At<std::uint32_t>(at + 42),       At<std::uint16_t>(at + 8),  At<std::uint16_t>(at + 10)};
    Widen(central, at + kCentralBytes + name, extra);
    at += kCentralBytes + name + extra + comment;
    return central;
  }
  /// Sizes that need 64 bits lie in extra field 1, in this order, only those that need it.
  void Widen(Central& central, std::size_t at, std::size_t length) const {
    const std::size_t end = at + length;
    for (std::size_t next = at; at + 4 <= end; at = next) {
      next = at + 4 + At<std::uint16_t>(at + 2);
      if (next > end) throw Broken("'" + central.name + "' has an extra field that is cut off");
      if (At<std::uint16_t>(at) != 1) continue;
      std::size_t field = at + 4;
      for (std::uint64_t* value : {&central.size, &central.packed, &central.local}) {
        if (*value != kIn64) continue;
        if (field + 8 > next) throw Broken("'" + central.name + "' lacks its 64-bit size");
        *value = At<std::uint64_t>(field);
        field += 8;
      }
    }
  }

  std::span<const std::byte> BytesOf(const Central& central) const {
    if ((central.flags & 1) != 0) throw Broken("'" + central.name + "' is encrypted");
    if (central.method != 0) throw Broken("'" + central.name + "' is compressed; torch.save stores");
    if (central.packed != central.size) throw Broken("'" + central.name + "' has two sizes");
    if (central.local > file_.size() || At<std::uint32_t>(static_cast<std::size_t>(central.local)) != kLocal)
      throw Broken("'" + central.name + "' is not where the directory says");
    const auto local = static_cast<std::size_t>(central.local);
    const std::size_t name = At<std::uint16_t>(local + 26), extra = At<std::uint16_t>(local + 28);
    if (TextAt(local + kLocalBytes, name) != central.name) throw Broken("'" + central.name + "' has two names");
    const std::size_t begin = local + kLocalBytes + name + extra;
    if (begin > file_.size() || central.size > file_.size() - begin)
      throw Broken("'" + central.name + "' claims " + std::to_string(central.size) + " bytes from byte " +
                   std::to_string(begin) + ", the file has " + std::to_string(file_.size()));
    return file_.subspan(begin, static_cast<std::size_t>(central.size));
  }

  std::span<const std::byte> file_;
  const std::string& name_;
};

}  // namespace

std::vector<ZipEntry> ReadZip(std::span<const std::byte> file, const std::string& name) {
  return ZipReader(file, name).Read();
}

}  // namespace evac
