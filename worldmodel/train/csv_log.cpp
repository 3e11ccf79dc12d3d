#include "worldmodel/train/csv_log.h"

#include <cstdlib>
#include <fstream>

#include "core/tensor_file.h"

namespace evac::train {

void CsvLog::Trim(const std::filesystem::path& path, const std::string& header, std::int64_t from) {
  std::string kept = header + "\n";
  std::ifstream rows(path);
  std::string row;
  std::getline(rows, row);  // the header
  while (std::getline(rows, row)) {
    char* end = nullptr;
    const std::int64_t step = std::strtoll(row.c_str(), &end, 10);
    if (end != row.c_str() && *end == ',' && step < from) kept += row + "\n";
  }
  rows.close();
  std::ofstream written(path, std::ios::trunc);
  if (!(written << kept).flush()) throw TensorError(path.string() + ": cannot be written");
}

void CsvLog::Add(const std::filesystem::path& path, const std::string& row) {
  std::ofstream rows(path, std::ios::app);
  if (!(rows << row << "\n").flush()) throw TensorError(path.string() + ": cannot be written");
}

}  // namespace evac::train
