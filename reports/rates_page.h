#pragma once

#include <string>
#include <vector>

#include "reports/chart_files.h"
#include "reports/correlation.h"

/// What `evac report --pairs` writes: rates that somebody published, or counted elsewhere, in two worlds. No episodes,
/// no clips; the numbers are those of `evac correlate --pairs` (correlation_output.h).
namespace evac {

/// One page that opens from disk: a table of all groups, then each with its chart, statistics and points. The same bytes
/// for the same groups.
/// @param source   the table's name. @param program  "evac 0.1.0"
std::string RatesPage(const std::vector<CorrelationGroup>& groups, const std::string& source,
                      const std::string& program);

/// The chart of each group whose rates lie within 0 and 100 %.
std::vector<ChartFile> ChartFilesOf(const std::vector<CorrelationGroup>& groups);

}  // namespace evac
