#include "core/run_extent.h"

#include <algorithm>
#include <map>
#include <string>
#include <tuple>

namespace evac {

RunExtent ExtentOf(std::span<const PlannedEpisodes> plan, const std::vector<Episode>& episodes,
                   const std::function<bool(const PlannedEpisodes&)>& is_meant) {
  using Cell = std::tuple<std::string, std::string, std::string, std::string>;
  std::map<Cell, std::int64_t> there;
  if (plan.empty()) return {};  // a run may be of a million
  for (const Episode& episode : episodes) {
    const auto& [pair, world] = episode.key;
    ++there[{pair.task, world, pair.policy, pair.checkpoint}];
  }
  RunExtent extent;
  for (const PlannedEpisodes& one : plan) {
    if (is_meant && !is_meant(one)) continue;
    const std::int64_t left = one.episodes - there[{one.task, one.world, one.policy, one.checkpoint}];
    extent.planned += one.episodes;
    extent.missing += std::max<std::int64_t>(0, left);
  }
  return extent;
}

}  // namespace evac
