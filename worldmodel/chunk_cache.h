#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "worldmodel/conditioning.h"

namespace evac {

struct ChunkCacheOptions {
  std::filesystem::path folder;  ///< made if absent; may be shared by several processes, and hold other files too
  double limit_gb = 10;          ///< 10^9 bytes; beyond it the entries that were not used for longest are removed. Of
                                 ///< the folder: where several processes write, each may exceed it by a tenth
};

/// What was imagined of one chunk.
struct CachedChunk {
  std::vector<std::vector<float>> latents;  ///< [count][V, z, h, w]
  Pictures pictures;                        ///< [count][V], all of one size
};

/// Chunks by everything that decides them: an interrupted or repeated run does not pay twice.
///
/// An entry is one file, FOLDER/<first 2 digits>/<key>.safetensors, with a hash of its content: it is written beside
/// its name and renamed, so a reader finds it whole or not at all, in any number of threads and processes. One that is
/// broken is a miss and a warning; a folder that cannot be written costs the cache, not the run. Files of other names,
/// and of other folders below, are somebody's: they are not counted and never removed. What other processes keep is
/// counted anew whenever this one has kept a tenth of the limit.
class ChunkCache {
 public:
  /// @throws InvalidInput if the folder cannot be made, or the limit is not positive.
  explicit ChunkCache(ChunkCacheOptions options);

  /// @param key  64 hex digits
  std::optional<CachedChunk> Find(const std::string& key);
  void Keep(const std::string& key, const CachedChunk& chunk);

 private:
  std::filesystem::path PathOf(const std::string& key) const;
  void Warn(const std::string& what);
  void CountAnew();

  ChunkCacheOptions options_;
  std::mutex mutex_;         ///< of the writing
  std::uintmax_t size_ = 0;  ///< bytes, as far as this process knows
  std::uintmax_t kept_ = 0;  ///< bytes that it kept since it counted
  bool warned_ = false;
};

}  // namespace evac
