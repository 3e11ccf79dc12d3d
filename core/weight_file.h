#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/tensor_file.h"

namespace evac {

/// The weights of a small network (a judge's, a policy's) and the card that travels with them: one safetensors file
/// whose metadata says what the network is for, what it was trained on and how good it is.
///
/// Strict: what is taken must be there in that shape, and all that is there must be taken; a network that silently
/// keeps something else judges or acts silently wrong.
class WeightFile {
 public:
  /// @param format  what the card's `format` must be: "evac-classifier 1"
  /// @throws InvalidInput naming the file: not there, not safetensors, or weights of something else (found, wanted).
  WeightFile(const std::filesystem::path& path, const std::string& format);

  /// A field of the card. @throws InvalidInput naming file and field: missing, or no finite number.
  const std::string& Text(const std::string& field) const;
  double Number(const std::string& field) const;
  /// A field that is a whole number in [low, high].
  int Whole(const std::string& field, int low, int high) const;
  /// A field that lists names with commas between them; never empty.
  std::vector<std::string> Names(const std::string& field) const;

  /// The numbers of a tensor of floats, all finite; the bytes live as long as this.
  /// @throws InvalidInput naming file and tensor: missing, of another type or shape (found, wanted), not finite.
  const TensorView& Take(const std::string& tensor, const std::vector<std::int64_t>& shape);
  /// @throws InvalidInput naming a tensor that nobody took.
  void RequireAllTaken() const;

  const std::string& name() const { return file_.name(); }
  const TensorMetadata& card() const { return file_.metadata(); }

 private:
  TensorFile file_;
  std::set<std::string> taken_;
};

}  // namespace evac
