#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "reports/correlation.h"

namespace evac {

struct PairsCsv {
  std::vector<CorrelationPoint> points;  ///< one per row, in the order of the file; `group` is "all" where it was empty
  std::vector<std::string> warnings;     ///< one sentence each, with file and line
};

/// Reads points from CSV (docs/formats/pairs_csv.md): a header naming group, task, policy, real_sr, sim_sr in any
/// order, then one point a row. Quoted cells, CRLF and a UTF-8 byte order mark are understood. Rates are any finite
/// numbers; one outside [0, 1] is warned about, and so is a column that nobody reads.
/// @param file  what messages call the text.
/// @throws InvalidInput "FILE:LINE: column C: found X, wanted Y" at the first thing that is wrong.
PairsCsv ReadPairsCsv(std::string_view text, const std::string& file);

}  // namespace evac
