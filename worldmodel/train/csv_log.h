#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace evac::train {

/// A table whose first column is the step. Rows of steps that were done but not saved before a kill go when the
/// training goes on: they are done again.
class CsvLog {
 public:
  /// For a table where nothing was trained yet. @throws TensorError naming it if it has another header: it is somebody's
  static void RequireOwn(const std::filesystem::path& path, const std::string& header);
  /// For such a table that no killed training left. @throws TensorError naming it if anything follows the header: it
  /// would be lost
  static void RequireNoRows(const std::filesystem::path& path, const std::string& header);
  /// The file is written only where it changes, and replaced at once.
  /// @param from  rows of this step and later are dropped
  static void Trim(const std::filesystem::path& path, const std::string& header, std::int64_t from);
  /// Adds a row. @throws TensorError with the system's reason.
  static void Add(const std::filesystem::path& path, const std::string& row);
};

}  // namespace evac::train
