#pragma once

#include <string>
#include <vector>

namespace evac {

/// Columns padded to their widest cell (in characters, not bytes), two blanks between, one line per row, none padded at
/// its end. Rows may differ in length.
std::string TextTable(const std::vector<std::vector<std::string>>& rows);

}  // namespace evac
