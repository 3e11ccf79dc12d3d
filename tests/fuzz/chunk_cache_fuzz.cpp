#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/hash.h"
#include "core/tensor_file.h"
#include "tests/fuzz/scratch.h"
#include "worldmodel/chunk_cache.h"

namespace {

const std::string kKey(64, 'a');

void Require(bool holds) {
  if (!holds) std::abort();
}

std::string HashOf(const evac::TensorView& tensor) {
  return evac::Sha256Hex({reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size()});
}

/// As the bytes are, and, if they are latents and pictures, with the hash that is right: no change of bytes finds that.
void WriteEntry(const std::filesystem::path& path, const std::string& bytes) try {
  const evac::TensorFile file = evac::TensorFile::Parse(bytes, "fuzz");
  const std::string hash = evac::Sha256Hex(HashOf(file.Get("latents")) + HashOf(file.Get("pictures")));
  evac::WriteTensorFile(path, file.tensors(), {{"format", "evac chunk 1"}, {"sha256", hash}});
} catch (const evac::TensorError&) {
}

}  // namespace

/// The warnings of what is a miss; the fuzzer's own output keeps its place.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  stderr = std::fopen("/dev/null", "w");
  return 0;
}

/// Any bytes are a cache's entry with as many frames as pictures, all of one size, none without numbers, or a miss.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  static evac::ChunkCache cache({.folder = scratch.folder()});
  std::filesystem::create_directories(scratch.folder() / "aa");
  scratch.Write("aa/" + kKey + ".safetensors", data, size);
  WriteEntry(scratch.folder() / "aa" / (kKey + ".safetensors"), {reinterpret_cast<const char*>(data), size});
  const std::optional<evac::CachedChunk> chunk = cache.Find(kKey);
  if (!chunk) return 0;
  Require(!chunk->latents.empty() && chunk->latents.size() == chunk->pictures.size());
  for (const std::vector<float>& latent : chunk->latents)
    Require(!latent.empty() && latent.size() == chunk->latents.front().size());
  for (const std::vector<cv::Mat>& views : chunk->pictures) {
    Require(!views.empty() && views.size() == chunk->pictures.front().size());
    for (const cv::Mat& view : views) Require(!view.empty() && view.size() == chunk->pictures[0][0].size());
  }
  return 0;
}
