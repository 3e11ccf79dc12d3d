#include "core/run_extent.h"

#include <map>
#include <string>
#include <tuple>

namespace evac {

std::vector<PlannedEpisodes> MissingOf(std::span<const PlannedEpisodes> plan, const std::vector<Episode>& episodes) {
  using Cell = std::tuple<std::string, std::string, std::string, std::string>;
  std::map<Cell, std::int64_t> there;
  if (plan.empty()) return {};  // a run may be of a million
  for (const Episode& episode : episodes) {
    const auto& [pair, world] = episode.key;
    ++there[{pair.task, world, pair.policy, pair.checkpoint}];
  }
  std::vector<PlannedEpisodes> missing;
  for (const PlannedEpisodes& one : plan) {
    const std::int64_t left = one.episodes - there[{one.task, one.world, one.policy, one.checkpoint}];
    if (left > 0) missing.emplace_back(one).episodes = left;
  }
  return missing;
}

RunExtent ExtentOf(std::span<const PlannedEpisodes> plan, const std::vector<Episode>& episodes,
                   const std::function<bool(const PlannedEpisodes&)>& is_meant) {
  const auto count = [&](std::span<const PlannedEpisodes> parts) {
    std::int64_t sum = 0;
    for (const PlannedEpisodes& one : parts) sum += !is_meant || is_meant(one) ? one.episodes : 0;
    return sum;
  };
  return {count(plan), count(MissingOf(plan, episodes))};
}

}  // namespace evac
