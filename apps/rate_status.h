#pragma once

#include <cstdint>

#include "core/store_study.h"

namespace evac {

/// How far a study is and how raters agree, for people or (as_json) all that the lead's board shows; to stdout.
void PrintRatingStatus(const StudyStore& store, std::int64_t now_ms, bool as_json);

}  // namespace evac
