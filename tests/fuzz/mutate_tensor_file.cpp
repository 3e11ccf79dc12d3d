#include "tests/fuzz/mutate_tensor_file.h"

#include <cstdint>
#include <iterator>
#include <random>
#include <vector>

#include "core/tensor_file.h"
#include "core/tensor_file_header.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

struct File {
  std::vector<evac::TensorDeclaration> tensors;
  std::vector<std::string> bytes;  ///< of each
  evac::TensorMetadata metadata;
};

File Parsed(const std::string& bytes) {
  const evac::TensorFile file = evac::TensorFile::Parse(bytes, "fuzz");
  File parsed{{file.tensors().begin(), file.tensors().end()}, {}, file.metadata()};
  for (const evac::TensorView& tensor : file.tensors())
    parsed.bytes.emplace_back(reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size());
  return parsed;
}

std::string BytesOf(const File& file) {
  std::string bytes = evac::TensorHeaderText(file.tensors, file.metadata);
  const std::uint64_t length = bytes.size();
  bytes.insert(0, reinterpret_cast<const char*>(&length), sizeof length);
  for (const std::string& tensor : file.bytes) bytes += tensor;
  return bytes;
}

void MutateText(std::string& text, std::size_t max_size) {
  const std::size_t size = text.size();
  text.resize(max_size);
  text.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(text.data()), size, max_size));
}

void ChangeSize(File& file, std::size_t which, std::size_t axis, std::int64_t to, bool everywhere) {
  if (axis >= file.tensors[which].shape.size()) {
    file.tensors[which].shape.push_back(to);
    return;
  }
  const std::int64_t from = file.tensors[which].shape[axis];
  for (std::size_t i = 0; i < file.tensors.size(); ++i) {
    std::vector<std::int64_t>& shape = file.tensors[i].shape;
    if ((i == which || everywhere) && axis < shape.size() && shape[axis] == from) shape[axis] = to;
  }
}

void Change(File& file, unsigned seed) {
  std::minstd_rand dice(seed);
  const auto below = [&](std::size_t count) { return static_cast<std::size_t>(dice() >> 8) % count; };
  const std::size_t which = below(file.tensors.size()), kind = below(6);
  const std::size_t side = below(3) * below(9);  // often none
  if (kind > 2) ChangeSize(file, which, below(6), static_cast<std::int64_t>(side), below(2) == 0);
  if (kind == 0) file.tensors[which].type = static_cast<evac::TensorType>(below(10));
  if (kind == 1 && !file.bytes[which].empty()) MutateText(file.bytes[which], file.bytes[which].size());
  if (kind == 2 && !file.metadata.empty()) {
    const auto entry = static_cast<std::ptrdiff_t>(below(file.metadata.size()));
    std::string& value = std::next(file.metadata.begin(), entry)->second;
    MutateText(value, value.size() + 4);
  }
}

}  // namespace

std::string MutatedTensorFile(const std::string& bytes, unsigned seed, std::size_t max_size) {
  try {
    File file = Parsed(bytes);
    if (file.tensors.empty()) return "";
    Change(file, seed);
    for (std::size_t i = 0; i < file.tensors.size(); ++i) {
      const std::size_t count = file.tensors[i].ByteCount();
      if (count > max_size) return "";
      file.bytes[i].resize(count);
    }
    const std::string mutated = BytesOf(file);
    return mutated.size() <= max_size ? mutated : "";
  } catch (const evac::TensorError&) {
    return "";
  }
}
