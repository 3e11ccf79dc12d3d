#include "worldmodel/chunk_cache.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "core/error.h"
#include "core/hash.h"
#include "core/tensor_file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "evac chunk 1";
constexpr std::size_t kGroupDigits = 2, kKeyDigits = 64;
constexpr std::string_view kEnding = ".safetensors";
constexpr std::string_view kPartial = ".partial-";  ///< behind it the number of the process: TensorFileWriter's
constexpr auto kAbandoned = std::chrono::hours(24);  ///< a file that nobody has finished by then

struct Entry {
  fs::path path;
  fs::file_time_type used;
  std::uintmax_t bytes = 0;
};

bool IsHex(std::string_view text, std::size_t digits) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

enum class Kind { kEntry, kUnfinished, kOfOthers };

/// @param group  the folder's name that the file lies in: the first 2 digits of its key
Kind KindOf(std::string_view name, std::string_view group) {
  if (!name.starts_with(group) || !IsHex(name.substr(0, kKeyDigits), kKeyDigits)) return Kind::kOfOthers;
  name.remove_prefix(kKeyDigits);
  if (!name.starts_with(kEnding)) return Kind::kOfOthers;
  name.remove_prefix(kEnding.size());
  if (name.empty()) return Kind::kEntry;
  const bool is_partial = name.starts_with(kPartial) && name.size() > kPartial.size() &&
                          name.find_first_not_of("0123456789", kPartial.size()) == std::string_view::npos;
  return is_partial ? Kind::kUnfinished : Kind::kOfOthers;
}

/// Adds the entries of one folder of a cache, and removes what nobody has finished there.
void AddEntries(const fs::path& group, std::vector<Entry>& entries) {
  std::error_code gone;
  for (fs::directory_iterator at(group, gone), end; !gone && at != end; at.increment(gone)) {
    const Kind kind = KindOf(at->path().filename().string(), group.filename().string());
    std::error_code error;
    if (kind == Kind::kOfOthers || !at->is_regular_file(error) || error) continue;
    const fs::file_time_type used = at->last_write_time(error);
    const std::uintmax_t bytes = error ? 0 : at->file_size(error);
    if (error) continue;
    const bool is_old = fs::file_time_type::clock::now() - used > kAbandoned;
    if (kind == Kind::kEntry) entries.push_back({at->path(), used, bytes});
    if (kind == Kind::kUnfinished && is_old) fs::remove(at->path(), error);
  }
}

/// By their names alone: the folder may be one that people keep their own files in, and those are never looked at.
/// Files that vanish meanwhile, because another process evicts too, are left out.
std::vector<Entry> EntriesOf(const fs::path& folder) {
  std::vector<Entry> entries;
  std::error_code gone;
  for (fs::directory_iterator at(folder, gone), end; !gone && at != end; at.increment(gone)) {
    std::error_code error;
    if (IsHex(at->path().filename().string(), kGroupDigits) && at->is_directory(error)) AddEntries(at->path(), entries);
  }
  return entries;
}

std::uintmax_t TotalOf(const std::vector<Entry>& entries) {
  std::uintmax_t total = 0;
  for (const Entry& entry : entries) total += entry.bytes;
  return total;
}

template <typename T>
std::span<const std::byte> BytesOf(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

std::string HashOf(std::span<const std::byte> latents, std::span<const std::byte> pictures) {
  const auto text = [](std::span<const std::byte> bytes) {
    return Sha256Hex({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  };
  return Sha256Hex(text(latents) + text(pictures));
}

std::vector<std::uint8_t> BytesOf(const Pictures& pictures) {
  std::vector<std::uint8_t> bytes;
  for (const std::vector<cv::Mat>& views : pictures) {
    for (const cv::Mat& picture : views) {
      const cv::Mat rows = picture.isContinuous() ? picture : picture.clone();
      bytes.insert(bytes.end(), rows.data, rows.data + rows.total() * 3);
    }
  }
  return bytes;
}

/// Where a side is 0 there are no bytes, and any number of frames: who counts those has no end.
bool IsEmpty(const TensorView& tensor) {
  return std::any_of(tensor.shape.begin(), tensor.shape.end(), [](std::int64_t side) { return side <= 0; });
}

/// @throws TensorError, also where an entry was changed after it was written.
CachedChunk Read(const fs::path& path) {
  const TensorFile file = TensorFile::Open(path);
  const TensorView &latents = file.Get("latents"), &pictures = file.Get("pictures");
  const auto format = file.metadata().find("format"), hash = file.metadata().find("sha256");
  const bool is_whole = format != file.metadata().end() && format->second == kFormat && hash != file.metadata().end() &&
                        latents.type == TensorType::kF32 && latents.shape.size() == 2 &&
                        pictures.type == TensorType::kU8 && pictures.shape.size() == 5 && pictures.shape[4] == 3 &&
                        pictures.shape[0] == latents.shape[0] && !IsEmpty(latents) && !IsEmpty(pictures) &&
                        hash->second == HashOf(latents.bytes, pictures.bytes);
  if (!is_whole) throw TensorError(path.string() + ": not what was written there");
  CachedChunk chunk;
  const auto values = static_cast<std::size_t>(latents.shape[1]);
  const int height = static_cast<int>(pictures.shape[2]), width = static_cast<int>(pictures.shape[3]);
  const std::byte* picture = pictures.bytes.data();
  for (std::size_t k = 0; k < static_cast<std::size_t>(latents.shape[0]); ++k) {
    std::memcpy(chunk.latents.emplace_back(values).data(), latents.bytes.data() + k * values * sizeof(float),
                values * sizeof(float));
    std::vector<cv::Mat>& views = chunk.pictures.emplace_back();
    for (std::int64_t v = 0; v < pictures.shape[1]; ++v, picture += views.back().total() * 3)
      std::memcpy(views.emplace_back(height, width, CV_8UC3).data, picture,
                  static_cast<std::size_t>(height) * static_cast<std::size_t>(width) * 3);
  }
  return chunk;
}

void Write(const fs::path& path, const CachedChunk& chunk) {
  std::vector<float> values;
  for (const std::vector<float>& frame : chunk.latents) values.insert(values.end(), frame.begin(), frame.end());
  const std::vector<std::uint8_t> bytes = BytesOf(chunk.pictures);
  const auto count = static_cast<std::int64_t>(chunk.latents.size());
  const cv::Mat& picture = chunk.pictures.front().front();
  const auto views = static_cast<std::int64_t>(chunk.pictures.front().size());
  const TensorView tensors[] = {
      {{"latents", TensorType::kF32, {count, static_cast<std::int64_t>(values.size()) / count}}, BytesOf(values)},
      {{"pictures", TensorType::kU8, {count, views, picture.rows, picture.cols, 3}}, BytesOf(bytes)}};
  WriteTensorFile(path, tensors, {{"format", kFormat}, {"sha256", HashOf(tensors[0].bytes, tensors[1].bytes)}});
}

}  // namespace

ChunkCache::ChunkCache(ChunkCacheOptions options) : options_(std::move(options)) {
  if (!(options_.limit_gb > 0))
    throw InvalidInput("chunk cache: found limit_gb {}, wanted more than 0", options_.limit_gb);
  std::error_code error;
  fs::create_directories(options_.folder, error);
  if (error) throw InvalidInput("chunk cache {}: {}", options_.folder.string(), error.message());
  size_ = TotalOf(EntriesOf(options_.folder));
}

fs::path ChunkCache::PathOf(const std::string& key) const {
  return options_.folder / key.substr(0, kGroupDigits) / (key + std::string(kEnding));
}

std::optional<CachedChunk> ChunkCache::Find(const std::string& key) {
  const fs::path path = PathOf(key);
  std::error_code error;
  if (!fs::exists(path, error)) return std::nullopt;
  try {
    CachedChunk chunk = Read(path);
    fs::last_write_time(path, fs::file_time_type::clock::now(), error);  // it is needed: others go first
    return chunk;
  } catch (const TensorError& why) {
    if (fs::exists(path, error)) Warn(why.what());  // else another process removed it
    return std::nullopt;
  }
}

void ChunkCache::Keep(const std::string& key, const CachedChunk& chunk) {
  const std::lock_guard lock(mutex_);
  const fs::path path = PathOf(key);
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  try {
    Write(path, chunk);
  } catch (const TensorError& why) {
    if (!std::exchange(warned_, true)) Warn(why.what());
    return;
  }
  const std::uintmax_t bytes = fs::file_size(path, error);
  if (error) return;  // another process removed it
  size_ += bytes;
  kept_ += bytes;
  const double limit = options_.limit_gb * 1e9;
  if (static_cast<double>(size_) > limit || static_cast<double>(kept_) > limit / 10) CountAnew();
}

void ChunkCache::Warn(const std::string& what) {
  std::fprintf(stderr, "evac: warning: chunk cache: %s; it is imagined again\n", what.c_str());
}

/// Where there is too much, down to nine tenths of the limit, so that it is not done for every chunk.
void ChunkCache::CountAnew() {
  std::vector<Entry> entries = EntriesOf(options_.folder);
  size_ = TotalOf(entries);
  kept_ = 0;
  const double limit = options_.limit_gb * 1e9;
  if (static_cast<double>(size_) <= limit) return;
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.used < b.used; });
  for (const Entry& entry : entries) {
    if (static_cast<double>(size_) <= 0.9 * limit) break;
    std::error_code error;
    fs::remove(entry.path, error);
    size_ -= entry.bytes;
  }
}

}  // namespace evac
