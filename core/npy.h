#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace evac {

/// A NumPy array as numbers: enough for trajectories and matrices.
struct NpyArray {
  std::string dtype = "<f8";       ///< as in the file: <f4, <f8, <i4, <i8 or |u1
  std::vector<std::size_t> shape;  ///< empty: a single number
  std::vector<double>
      values;  ///< C order (last index fastest), whatever the file's order; integers beyond 2^53 are rounded

  /// `array.At(row, column)` of a matrix; the caller has checked the shape.
  double At(std::size_t row, std::size_t column) const { return values[row * shape[1] + column]; }
};

/// Reads a .npy file: format 1 to 3, little-endian f4, f8, i4, i8 or u1, C or Fortran order
/// (https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html).
/// @throws InvalidInput naming the file, what was found and what was wanted: another type, a header that is none, a
/// shape that
///   is not that of the bytes there, more than 1 GiB.
NpyArray ReadNpy(const std::filesystem::path& path);
/// The same from bytes; `name` stands for the file in messages. Memory used is bounded by a small multiple of the
/// bytes.
NpyArray ParseNpy(std::string_view bytes, const std::string& name);

/// Format 1.0, C order. Values are converted to `array.dtype` (floats rounded, integers truncated).
/// @throws InvalidInput if shape and values disagree, the type is none of the five, or a value does not fit it.
std::string NpyBytes(const NpyArray& array);
void WriteNpy(const std::filesystem::path& path, const NpyArray& array);

}  // namespace evac
