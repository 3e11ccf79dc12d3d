#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/store.h"

namespace evac {

/// How much of what the suite asks for a run has: it may go on, have been broken off, or be one shard of several.
struct RunExtent {
  std::int64_t planned = 0;  ///< 0: nobody wrote it down, as of a run that an earlier evac began
  std::int64_t missing = 0;  ///< of those, neither ended nor failed yet
};

/// @param is_meant  of which part of the plan; none: of all of it
RunExtent ExtentOf(std::span<const PlannedEpisodes> plan, const std::vector<Episode>& episodes,
                   const std::function<bool(const PlannedEpisodes&)>& is_meant = {});

/// The parts of the plan that are not whole, with how many episodes of each are missing.
std::vector<PlannedEpisodes> MissingOf(std::span<const PlannedEpisodes> plan, const std::vector<Episode>& episodes);

}  // namespace evac
