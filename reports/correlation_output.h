#pragma once

#include <string>
#include <vector>

#include "reports/correlation.h"

namespace evac {

/// {"groups": [{"group", "n", "pearson", "spearman", "mmrv", "mmrv_convention", …}]}, indented, ending with a newline.
/// docs/formats/correlation_json.md names every key. Undefined is null beside "<key>_reason".
std::string CorrelationJson(const std::vector<CorrelationGroup>& groups);

/// The same for people: a table, how the intervals were made, and why what is missing is missing.
std::string CorrelationText(const std::vector<CorrelationGroup>& groups);

}  // namespace evac
