#include "worldmodel/train/sha256.h"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <set>

#include "worldmodel/nn/mapped_tensors.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

/// The first 32 bits of the fractional parts of the cube roots of the first 64 primes.
constexpr std::array<std::uint32_t, 64> kRounds = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

std::uint32_t BigEndian(const unsigned char* at) {
  return std::uint32_t{at[0]} << 24 | std::uint32_t{at[1]} << 16 | std::uint32_t{at[2]} << 8 | at[3];
}

}  // namespace

void Sha256::AddBlock(const unsigned char* block) {
  std::array<std::uint32_t, 64> w{};
  for (std::size_t i = 0; i < 16; ++i) w[i] = BigEndian(block + 4 * i);
  for (std::size_t i = 16; i < 64; ++i) {
    const std::uint32_t near = w[i - 2], far = w[i - 15];
    w[i] = w[i - 16] + (std::rotr(far, 7) ^ std::rotr(far, 18) ^ far >> 3) + w[i - 7] +
           (std::rotr(near, 17) ^ std::rotr(near, 19) ^ near >> 10);
  }
  auto [a, b, c, d, e, f, g, h] = state_;
  for (std::size_t i = 0; i < 64; ++i) {
    const std::uint32_t one = h + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) + ((e & f) ^ (~e & g)) +
                              kRounds[i] + w[i];
    const std::uint32_t two = (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
    h = g, g = f, f = e, e = d + one, d = c, c = b, b = a, a = one + two;
  }
  const std::array<std::uint32_t, 8> more = {a, b, c, d, e, f, g, h};
  for (std::size_t i = 0; i < 8; ++i) state_[i] += more[i];
}

void Sha256::Add(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t held = size_ % begun_.size(), taken = std::min(begun_.size() - held, bytes.size());
    std::memcpy(begun_.data() + held, bytes.data(), taken);
    size_ += taken;
    bytes.remove_prefix(taken);
    if (held + taken == begun_.size()) AddBlock(begun_.data());
  }
}

std::string Sha256::Hex() {
  const std::uint64_t bits = 8 * size_;
  std::string end(1, '\x80');
  end.append((119 - size_ % 64) % 64, '\0');
  for (int shift = 56; shift >= 0; shift -= 8) end += static_cast<char>(bits >> shift & 0xff);
  Add(end);
  std::string hex;
  for (const std::uint32_t word : state_) {
    char text[9];
    std::snprintf(text, sizeof text, "%08x", static_cast<unsigned>(word));
    hex += text;
  }
  return hex;
}

std::string Sha256OfFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path)) throw TensorError(path.string() + ": cannot be read");
  Sha256 sha;
  std::array<char, 1 << 16> buffer;
  while (file.read(buffer.data(), buffer.size()), file.gcount() > 0)
    sha.Add({buffer.data(), static_cast<std::size_t>(file.gcount())});
  if (file.bad()) throw TensorError(path.string() + ": cannot be read to its end");
  return sha.Hex();
}

std::string CodecSha256(const std::filesystem::path& weights) {
  const nn::MappedTensors tensors(TensorFile::OpenCheckpoint(weights));
  std::set<std::string> names;
  for (const TensorView& tensor : tensors.file().tensors()) {
    if (tensor.name.starts_with(kCodecPrefix)) names.insert(tensor.name);
  }
  if (names.empty())
    throw TensorError(weights.string() + ": no tensor begins with " + kCodecPrefix + ": it holds no codec");
  Sha256 sha;
  for (const std::string& name : names) {
    const at::Tensor tensor = tensors.Get(name).to(at::kFloat).contiguous();
    std::string line = name + " ";
    for (std::int64_t i = 0; i < tensor.dim(); ++i) {
      if (i > 0) line += ',';
      line += std::to_string(tensor.size(i));
    }
    sha.Add(line + "\n");
    sha.Add({static_cast<const char*>(tensor.data_ptr()), tensor.nbytes()});
  }
  return sha.Hex();
}

}  // namespace evac::train
