#include "reports/checkpoints.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <string_view>

#include "reports/wording.h"

namespace evac {
namespace {

/// Checkpoints by policy name, both in the order declared.
std::vector<std::pair<std::string, std::vector<std::string>>> FamiliesOf(const RunSummary& summary) {
  std::vector<std::pair<std::string, std::vector<std::string>>> families;
  for (const PolicyInfo& policy : summary.data.policies) {
    auto family = std::ranges::find(families, policy.name, [](const auto& entry) { return entry.first; });
    if (family == families.end()) family = families.insert(families.end(), {policy.name, {}});
    family->second.push_back(policy.checkpoint);
  }
  std::erase_if(families, [](const auto& family) { return family.second.size() < 2; });
  return families;
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// The number that a name ends with, and what stands before it.
struct Ending {
  std::string_view before;
  double step = 0;
};

/// Where the digits begin that end before `end`; `end` where there are none.
std::size_t DigitsBefore(const std::string& name, std::size_t end) {
  while (end > 0 && IsDigit(name[end - 1])) --end;
  return end;
}

std::optional<Ending> EndingOf(const std::string& checkpoint) {
  std::size_t end = checkpoint.size();
  double unit = 1;
  if (end > 0 && (checkpoint[end - 1] == 'k' || checkpoint[end - 1] == 'M')) {
    unit = checkpoint[end - 1] == 'k' ? 1e3 : 1e6;
    --end;
  }
  std::size_t begin = DigitsBefore(checkpoint, end);
  if (unit > 1 && begin > 0 && begin < end && checkpoint[begin - 1] == '.') {
    const std::size_t whole = DigitsBefore(checkpoint, begin - 1);
    if (whole < begin - 1) begin = whole;
  }
  double step = 0;
  const auto [stop, error] = std::from_chars(checkpoint.data() + begin, checkpoint.data() + end, step);
  if (begin == end || error != std::errc() || stop != checkpoint.data() + end) return std::nullopt;
  return Ending{std::string_view(checkpoint).substr(0, begin), step * unit};
}

/// Of a date or a version the last number alone says nothing: 2026-02-01 is after 2026-01-31.
bool DifferInTheirLastNumberAlone(const std::vector<std::string>& checkpoints) {
  const std::optional<Ending> first = EndingOf(checkpoints.front());
  return first && std::ranges::all_of(checkpoints, [&](const std::string& name) {
           const std::optional<Ending> ending = EndingOf(name);
           return ending && ending->before == first->before;
         });
}

std::vector<CheckpointPoint> PointsInOrder(const std::vector<std::string>& checkpoints, bool& has_steps) {
  has_steps = DifferInTheirLastNumberAlone(checkpoints);
  std::vector<CheckpointPoint> points;
  for (const std::string& checkpoint : checkpoints) {
    points.push_back({checkpoint, has_steps ? *StepOf(checkpoint) : static_cast<double>(points.size()), {}});
  }
  std::ranges::stable_sort(points, {}, &CheckpointPoint::step);
  return points;
}

std::vector<std::string> WorldsWithReal(const RunSummary& summary) {
  std::vector<std::string> worlds;
  for (const WorldInfo& world : summary.data.worlds) worlds.push_back(world.name);
  std::ranges::stable_partition(worlds, [&](const std::string& world) { return world == summary.reference; });
  return worlds;
}

ComparedPolicy EpisodesOf(const RunSummary& summary, const CheckpointCurve& curve, const std::string& checkpoint,
                          const std::string& world) {
  ComparedPolicy policy{PolicyLabel(curve.policy, checkpoint), {}};
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, in_world] = judged.episode.key;
    if (in_world == world && pair.task == curve.task && pair.policy == curve.policy && pair.checkpoint == checkpoint)
      policy.episodes.push_back(judged);
  }
  return policy;
}

void AddRates(const RunSummary& summary, CheckpointCurve& curve) {
  for (CheckpointPoint& point : curve.points) {
    const std::string label = PolicyLabel(curve.policy, point.checkpoint);
    for (const std::string& world : curve.worlds) {
      const auto cell = std::ranges::find_if(summary.rates, [&](const RateCell& rate) {
        return rate.task == curve.task && rate.policy == label && rate.world == world;
      });
      Estimate none;
      none.value = Undefined{"no episode"};
      none.interval = Undefined{"no episode"};
      none.method = "none";
      point.rate.push_back(cell == summary.rates.end() ? none : cell->rate);
    }
  }
}

void AddEnds(const RunSummary& summary, CheckpointCurve& curve) {
  for (const std::string& world : curve.worlds) {
    const ComparedPolicy last = EpisodesOf(summary, curve, curve.points.back().checkpoint, world);
    const ComparedPolicy first = EpisodesOf(summary, curve, curve.points.front().checkpoint, world);
    if (last.episodes.empty() || first.episodes.empty()) {
      curve.ends.emplace_back();
    } else {
      curve.ends.emplace_back(ComparePolicies(last, first, {.alpha = 1 - summary.options.confidence}));
    }
  }
}

/// "1 of 3 steps rise", of the neighbours that both have a rate.
std::string RisesInWords(const CheckpointCurve& curve, std::size_t world) {
  std::int64_t rises = 0, steps = 0;
  for (std::size_t i = 1; i < curve.points.size(); ++i) {
    const Number& before = curve.points[i - 1].rate[world].value;
    const Number& after = curve.points[i].rate[world].value;
    if (!before || !after) continue;
    ++steps;
    rises += *after > *before;
  }
  return steps == 0 ? "no two neighbours are judged" : fmt::format("{} of {} rise", rises, Counted(steps, "step"));
}

}  // namespace

std::optional<double> StepOf(const std::string& checkpoint) {
  const std::optional<Ending> ending = EndingOf(checkpoint);
  return ending ? std::optional(ending->step) : std::nullopt;
}

std::vector<CheckpointCurve> CheckpointsOf(const RunSummary& summary) {
  std::vector<CheckpointCurve> curves;
  for (const auto& [policy, checkpoints] : FamiliesOf(summary)) {
    for (const Task& task : summary.data.tasks) {
      CheckpointCurve curve{task.id, policy, false, WorldsWithReal(summary), {}, {}};
      curve.points = PointsInOrder(checkpoints, curve.has_steps);
      AddRates(summary, curve);
      AddEnds(summary, curve);
      curves.push_back(std::move(curve));
    }
  }
  return curves;
}

std::string TrendInWords(const CheckpointCurve& curve, std::size_t world) {
  const std::string lead = fmt::format("In {}, from {} to {}", curve.worlds[world], curve.points.front().checkpoint,
                                       curve.points.back().checkpoint);
  if (!curve.ends[world]) return lead + ": no episodes of both.";
  const ComparisonRow& row = curve.ends[world]->all;
  if (!row.first.value || !row.second.value || !row.difference.interval || !row.p)
    return lead + ": no episodes of both count.";
  return fmt::format("{}: {} → {}, {} ({}, {}, {}); {}.", lead, Percent(*row.second.value),
                     Percent(*row.first.value), PointsWithInterval(row.difference), row.test, PValue(*row.p),
                     row.is_paired ? Counted(row.shared, "pair") : "unpaired", RisesInWords(curve, world));
}

}  // namespace evac
