#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>

#include "judges/rating_tally.h"

namespace evac {

/// Which clips' rows are wanted, of all: disputed ones first, then the others, each in the study's order.
struct BoardRows {
  std::size_t from = 0, count = std::numeric_limits<std::size_t>::max();
};

/// All that a study's lead sees, and `evac rate status --json`: clips with their votes, rates, agreement, raters with
/// concerns, blinding, disputes, leases. Numbers that are undefined are null with the reason beside them. They are of
/// the whole study, whichever rows are wanted.
/// @throws InvalidInput if the study is damaged (StudyStore::RequireWhole).
nlohmann::ordered_json RatingBoard(const StudyStore& store, std::int64_t now_ms, const BoardRows& wanted = {});
/// The same for whoever looks again and again: what `tally` knows of the study already is not read anew.
nlohmann::ordered_json RatingBoard(const StudyStore& store, RatingTally& tally, std::int64_t now_ms,
                                   const BoardRows& wanted = {});

}  // namespace evac
