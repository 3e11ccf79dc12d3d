#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

/// SHA-256 (FIPS 180-4) for a machine that has libtorch alone. The rest of evac has core/hash.h, which is faster and says
/// the same.
namespace evac::train {

class Sha256 {
 public:
  void Add(std::string_view bytes);
  /// Of all that was added, 64 lower-case hex digits; the last call.
  std::string Hex();

 private:
  void AddBlock(const unsigned char* block);

  std::array<std::uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                         0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> begun_{};  ///< the block that is not whole yet
  std::uint64_t size_ = 0;                 ///< bytes in all
};

/// @throws TensorError naming the file if it cannot be read
std::string Sha256OfFile(const std::filesystem::path& path);

/// Which codec a file holds, alone or in a checkpoint: SHA-256 of its tensors' names, shapes and numbers as floats, in
/// the order of their names. What else is in the file, and in which type, does not count: a world model that was
/// trained on keeps its codec's latents. docs/formats/shards.md
/// @throws TensorError if the file holds none, or is broken.
std::string CodecSha256(const std::filesystem::path& weights);

}  // namespace evac::train
