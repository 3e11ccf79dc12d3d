#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>

#include "core/store_study.h"

namespace evac {

/// All that a study's lead sees, and `evac rate status --json`: clips with their votes, rates, agreement, raters with
/// concerns, blinding, disputes, leases. Numbers that are undefined are null with the reason beside them.
nlohmann::ordered_json RatingBoard(const StudyStore& store, std::int64_t now_ms);

}  // namespace evac
