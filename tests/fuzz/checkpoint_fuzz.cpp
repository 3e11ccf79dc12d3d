#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/tensor_file.h"

/// Any bytes are a checkpoint of torch.save whose tensors fill their shapes within it, or a TensorError.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::TensorFile file =
        evac::TensorFile::ParseTorch(std::string(reinterpret_cast<const char*>(data), size), "fuzz");
    unsigned sum = 0;
    for (const evac::TensorView& tensor : file.tensors()) {
      if (tensor.bytes.size() != tensor.ByteCount()) std::abort();
      for (const std::byte byte : tensor.bytes) sum += static_cast<unsigned>(byte);
    }
    if (sum == ~0U) std::abort();
  } catch (const evac::TensorError&) {
  }
  return 0;
}
