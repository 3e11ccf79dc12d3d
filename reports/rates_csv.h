#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// Every cell of the report's rates, a row each, for spreadsheets (docs/formats/rates_csv.md): task, policy (with its
/// checkpoint), world, judge, episodes by outcome, initial_states, n, rate, low, high, confidence, method. Shares are
/// in [0, 1]; what is undefined is an empty cell.
std::string RatesCsv(const RunSummary& summary);

}  // namespace evac
