#pragma once

#include <string>
#include <vector>

#include "core/store.h"
#include "reports/summary.h"

namespace evac {

/// The rates of `Summarise`, cell by cell the same, counted while the store reads its rows: memory and time that a
/// million episodes ask for.
/// @throws InvalidInput unless 0 < confidence < 1.
std::vector<RateCell> TallyRates(const Store& store, const std::string& judge, double confidence);

}  // namespace evac
