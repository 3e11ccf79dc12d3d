#include "reports/stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "core/statistics/many_comparisons.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/rates.h"
#include "reports/findings.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// How many stages in a row were reached, from the first; nothing where the verdict does not tell.
std::optional<std::size_t> DepthOf(const JudgedEpisode& judged, const std::vector<std::string>& stages) {
  if (!judged.Counts() || !judged.verdict || judged.verdict->stages.empty()) return std::nullopt;
  std::size_t depth = 0;
  for (const std::string& stage : stages) {
    const auto reached = judged.verdict->stages.find(stage);
    if (reached == judged.verdict->stages.end()) return std::nullopt;
    if (!reached->second) break;
    ++depth;
  }
  return depth;
}

std::vector<std::string> StageNames(const Task& task) {
  std::vector<std::string> names;
  for (const Stage& stage : task.rubric.stages) names.push_back(stage.name);
  return names;
}

using DepthsByState = std::map<std::string, std::vector<std::size_t>>;      // initial state → its episodes' depths
using Cell = std::pair<std::string, std::string>;                           // policy, world
using DepthsByCell = std::map<std::string, std::map<Cell, DepthsByState>>;  // by task

DepthsByCell DepthsOf(const RunSummary& summary) {
  std::map<std::string, std::vector<std::string>> stages;
  for (const Task& task : summary.data.tasks) stages[task.id] = StageNames(task);
  DepthsByCell depths;
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, world] = judged.episode.key;
    const auto depth = DepthOf(judged, stages[pair.task]);
    if (!depth || stages[pair.task].empty()) continue;
    depths[pair.task][{PolicyLabel(pair.policy, pair.checkpoint), world}][pair.initial_state].push_back(*depth);
  }
  return depths;
}

StageRow RowOf(const std::string& world, const DepthsByState& states, std::size_t stages, double confidence) {
  StageRow row{world, {}};
  for (std::size_t stage = 0; stage < stages; ++stage) {
    std::vector<Count> counts;
    for (const auto& [state, depths] : states) {
      const auto reached = std::ranges::count_if(depths, [stage](std::size_t depth) { return depth > stage; });
      counts.push_back({reached, static_cast<std::int64_t>(depths.size())});
    }
    row.reached.push_back(ClusteredWilsonInterval(counts, confidence));
  }
  return row;
}

/// The real world first.
std::vector<std::string> WorldsInOrder(const RunSummary& summary) {
  std::vector<std::string> worlds;
  for (const WorldInfo& world : summary.data.worlds) worlds.push_back(world.name);
  std::stable_partition(worlds.begin(), worlds.end(),
                        [&](const std::string& world) { return world == summary.reference; });
  return worlds;
}

std::vector<StageFunnel> FunnelsOf(const RunSummary& summary) {
  DepthsByCell depths = DepthsOf(summary);
  std::vector<StageFunnel> funnels;
  for (const Task& task : summary.data.tasks) {
    for (const std::string& policy : summary.policies) {
      StageFunnel funnel{task.id, policy, StageNames(task), {}};
      for (const std::string& world : WorldsInOrder(summary)) {
        const DepthsByState& states = depths[task.id][{policy, world}];
        if (!states.empty())
          funnel.worlds.push_back(RowOf(world, states, funnel.stages.size(), summary.options.confidence));
      }
      if (!funnel.worlds.empty()) funnels.push_back(std::move(funnel));
    }
  }
  return funnels;
}

/// One stage of one task: its pairs by initial state.
using PairsByState = std::map<std::string, PairedOutcomes>;

void CountPairs(const RunSummary& summary, const PairTable& table, const std::vector<std::string>& stages,
                std::vector<PairsByState>& by_stage) {
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& in_real = summary.episodes[pair.real];
    const auto real = DepthOf(in_real, stages), other = DepthOf(summary.episodes[pair.other], stages);
    if (!real || !other) continue;
    const std::size_t together = std::min(*real, *other);
    for (std::size_t stage = 0; stage < stages.size() && stage <= together; ++stage) {
      PairedOutcomes& state = by_stage[stage][in_real.episode.key.pair.initial_state];
      ++state.pairs;
      state.flips.only_first += *other > stage && *real == stage;
      state.flips.only_second += *real > stage && *other == stage;
    }
  }
}

StageParting PartingOf(const PairsByState& states, StageParting parting) {
  std::vector<PairedOutcomes> clusters;
  for (const auto& [state, outcomes] : states) {
    clusters.push_back(outcomes);
    parting.pairs += outcomes.pairs;
    parting.flips.only_first += outcomes.flips.only_first;
    parting.flips.only_second += outcomes.flips.only_second;
  }
  if (parting.pairs == 0) return parting;
  const PairedOutcomes effective = EffectivePairs(clusters);
  parting.effective_pairs = effective.pairs;
  parting.p = McNemarExact(effective.flips).p_exact;
  return parting;
}

void AdjustForAll(std::vector<StageParting>& partings) {
  std::vector<double> p_values;
  for (const StageParting& parting : partings) {
    if (parting.p) p_values.push_back(*parting.p);
  }
  const std::vector<double> adjusted = HolmAdjusted(p_values);
  auto next = adjusted.begin();
  for (StageParting& parting : partings) {
    if (parting.p) parting.p_holm = *next++;
  }
}

std::vector<StageParting> PartingsOf(const RunSummary& summary, const WorldComparison& comparison) {
  std::vector<StageParting> partings;
  for (const Task& task : summary.data.tasks) {
    const std::vector<std::string> stages = StageNames(task);
    std::vector<PairsByState> by_stage(stages.size());
    for (const PairTable& table : comparison.tables) {
      if (table.task == task.id) CountPairs(summary, table, stages, by_stage);
    }
    for (std::size_t stage = 0; stage < stages.size(); ++stage) {
      StageParting parting;
      parting.task = task.id;
      parting.stage = stages[stage];
      parting.world = comparison.other;
      partings.push_back(PartingOf(by_stage[stage], std::move(parting)));
    }
  }
  AdjustForAll(partings);
  return partings;
}

}  // namespace

StageReport StagesOf(const RunSummary& summary) {
  StageReport report;
  report.funnels = FunnelsOf(summary);
  for (const StageFunnel& funnel : report.funnels) {
    for (const StageRow& row : funnel.worlds) {
      if (!row.reached.empty()) report.episodes += row.reached[0].n;
    }
  }
  if (report.funnels.empty()) return report;
  for (const WorldComparison& comparison : summary.comparisons) {
    for (StageParting& parting : PartingsOf(summary, comparison)) report.partings.push_back(std::move(parting));
  }
  return report;
}

std::string PartingInWords(const StageParting& parting, const std::string& reference) {
  if (!parting.p_holm) return fmt::format("{} at {}: {}", parting.world, parting.stage, parting.p_holm.reason());
  const auto [only_other, only_real] = parting.flips;
  const bool decided = *parting.p_holm < kAlpha;
  const std::string lead = decided ? fmt::format("{} is {} than {} at {}", parting.world,
                                                 only_other > only_real ? "kinder" : "harder", reference, parting.stage)
                                   : fmt::format("not decided at {}", parting.stage);
  return fmt::format("{}: of {}, {} went on in {} alone and {} in {} alone ({}, {} after Holm)", lead,
                     Counted(parting.pairs, "pair"), only_other, parting.world, only_real, reference,
                     OnPairs("exact McNemar", {parting.pairs, parting.effective_pairs}), PValue(*parting.p_holm));
}

}  // namespace evac
