#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/tensor_file.h"
#include "core/tensor_file_header.h"

/// Any bytes are a file of tensors that lie within it and whose header can be written and read again, or a TensorError.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::TensorFile file =
        evac::TensorFile::Parse(std::string(reinterpret_cast<const char*>(data), size), "fuzz");
    std::size_t bytes = 0;
    unsigned sum = 0;
    for (const evac::TensorView& tensor : file.tensors()) {
      bytes += tensor.bytes.size();
      for (const std::byte byte : tensor.bytes) sum += static_cast<unsigned>(byte);
    }
    if (bytes > size || sum == ~0U) std::abort();
    const std::vector<evac::TensorDeclaration> declarations(file.tensors().begin(), file.tensors().end());
    const std::string text = evac::TensorHeaderText(declarations, file.metadata());
    if (evac::ParseTensorHeader(text, "again").entries.size() != declarations.size()) std::abort();
  } catch (const evac::TensorError&) {
  }
  return 0;
}
