#include "worldmodel/train/csv_log.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>

#include "core/tensor_file.h"

namespace evac::train {
namespace {

std::string TextOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The table is there at every moment, as it was or as it is now.
void Replace(const std::filesystem::path& path, const std::string& text) {
  const std::filesystem::path part = path.string() + ".part";
  std::ofstream written(part, std::ios::binary | std::ios::trunc);
  if (!(written << text).flush()) throw TensorWriteError(part.string() + ": cannot be written: " + std::strerror(errno));
  written.close();
  std::error_code error;
  std::filesystem::rename(part, path, error);
  if (error) throw TensorWriteError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace

void CsvLog::RequireOwn(const std::filesystem::path& path, const std::string& header) {
  const std::string found = TextOf(path);
  if (!found.empty() && !found.starts_with(header + "\n"))
    throw TensorError(path.string() + ": is there and no training's (its first line is not '" + header +
                      "'), wanted that name free, or another folder");
}

void CsvLog::RequireNoRows(const std::filesystem::path& path, const std::string& header) {
  if (TextOf(path).size() <= header.size() + 1) return;
  throw TensorError(path.string() +
                    ": holds rows of a training whose training.safetensors is not beside it, and they would be lost; "
                    "wanted that name free (move it away to begin anew), or another folder");
}

void CsvLog::Trim(const std::filesystem::path& path, const std::string& header, std::int64_t from) {
  const std::string before = TextOf(path);
  std::string kept = header + "\n";
  std::istringstream rows(before);
  std::string row;
  std::getline(rows, row);  // the header
  while (std::getline(rows, row)) {
    char* end = nullptr;
    const std::int64_t step = std::strtoll(row.c_str(), &end, 10);
    if (end != row.c_str() && *end == ',' && step < from) kept += row + "\n";
  }
  if (kept != before) Replace(path, kept);
}

void CsvLog::Add(const std::filesystem::path& path, const std::string& row) {
  std::ofstream rows(path, std::ios::app);
  if (!(rows << row << "\n").flush()) throw TensorWriteError(path.string() + ": cannot be written: " + std::strerror(errno));
}

}  // namespace evac::train
