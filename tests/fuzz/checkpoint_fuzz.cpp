#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "core/tensor_file.h"
#include "core/tensor_file_pickle.h"

namespace {

/// A checkpoint of torch.save whose tensors fill their shapes and whose names are of the file's size, or a TensorError.
void AsCheckpoint(const std::string& bytes) {
  const evac::TensorFile file = evac::TensorFile::ParseTorch(bytes, "fuzz");
  unsigned sum = 0;
  std::size_t name_bytes = 0;
  for (const evac::TensorView& tensor : file.tensors()) {
    if (tensor.bytes.size() != tensor.ByteCount()) std::abort();
    name_bytes += tensor.name.size();
    for (const std::byte byte : tensor.bytes) sum += static_cast<unsigned>(byte);
  }
  if (sum == ~0U || name_bytes > 2 * bytes.size()) std::abort();
}

/// A pickle whose values hold values that are there, or a TensorError.
void AsPickle(const std::string& bytes) {
  const evac::Pickle pickle = evac::ReadPickle(std::as_bytes(std::span(bytes)), "fuzz");
  if (pickle.root >= pickle.values.size()) std::abort();
  for (const evac::PickleValue& value : pickle.values) {
    for (const std::uint32_t item : value.items) {
      if (item >= pickle.values.size()) std::abort();
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  try {
    bytes.starts_with("PK") ? AsCheckpoint(bytes) : AsPickle(bytes);
  } catch (const evac::TensorError&) {
  }
  return 0;
}
