#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/tensor_file.h"

namespace evac {

/// One entry of a safetensors header, as it is claimed there.
struct HeaderEntry : TensorDeclaration {
  std::size_t begin = 0, end = 0;  ///< bytes after the header
};

struct TensorHeader {
  std::vector<HeaderEntry> entries;  ///< in the text's order
  TensorMetadata metadata;
};

/// Reads the JSON of the header: strict, no recursion, memory bounded by a small multiple of the text.
/// @throws TensorError naming `file`.
TensorHeader ParseTensorHeader(std::string_view text, const std::string& file);

/// The JSON for these tensors laid end to end, padded with blanks to a multiple of 8 bytes.
std::string TensorHeaderText(std::span<const TensorDeclaration> tensors, const TensorMetadata& metadata);

}  // namespace evac
