#include "reports/tally.h"

#include <functional>
#include <map>
#include <tuple>

#include "core/error.h"
#include "core/statistics/rates.h"

namespace evac {
namespace {

using CellKey = std::tuple<std::string, std::string, std::string, std::string>;  ///< task, policy, checkpoint, world
using CellView = std::tuple<std::string_view, std::string_view, std::string_view, std::string_view>;

struct Counted {
  std::array<std::int64_t, kOutcomes> outcomes{};
  std::map<std::string, Count, std::less<>> states;  ///< those with a success or a failure
};
using Cells = std::map<CellKey, Counted, std::less<>>;

Counted& CellOf(const CellView& key, Cells& cells) {
  const auto found = cells.find(key);
  return found != cells.end() ? found->second : cells[CellKey(key)];
}

void CountOne(const EndedEpisode& ended, Counted& cell) {
  const Outcome outcome = OutcomeOf(ended.failed, ended.label);
  ++cell.outcomes[static_cast<std::size_t>(outcome)];
  if (outcome != Outcome::kSuccess && outcome != Outcome::kFailure) return;
  auto state = cell.states.find(ended.initial_state);
  if (state == cell.states.end()) state = cell.states.emplace(ended.initial_state, Count{}).first;
  ++state->second.trials;
  if (outcome == Outcome::kSuccess) ++state->second.successes;
}

Cells CountAll(const Store& store, const std::string& judge) {
  Cells cells;
  Counted* cell = nullptr;  // episodes come a cell at a time, nearly
  CellKey key;
  store.ForEachEnded(judge, [&](const EndedEpisode& ended) {
    const CellView its(ended.task, ended.policy, ended.checkpoint, ended.world);
    if (!cell || its != CellView(key)) {
      cell = &CellOf(its, cells);
      key = CellKey(its);
    }
    CountOne(ended, *cell);
  });
  return cells;
}

RateCell RateOfCounted(const CellKey& key, const Counted& counted, double confidence) {
  RateCell cell;
  cell.task = std::get<0>(key);
  cell.policy = PolicyLabel(std::get<1>(key), std::get<2>(key));
  cell.world = std::get<3>(key);
  cell.counts = counted.outcomes;
  cell.states = static_cast<std::int64_t>(counted.states.size());
  std::vector<Count> clusters;
  for (const auto& [state, count] : counted.states) clusters.push_back(count);
  cell.rate = ClusteredWilsonInterval(clusters, confidence);
  return cell;
}

}  // namespace

std::vector<RateCell> TallyRates(const Store& store, const std::string& judge, double confidence) {
  if (!(confidence > 0 && confidence < 1))
    throw InvalidInput("confidence is {}, wanted a number between 0 and 1", confidence);
  const Cells cells = CountAll(store, judge);
  std::vector<RateCell> rates;
  for (const Task& task : store.Tasks()) {
    for (const PolicyInfo& policy : store.Policies()) {
      for (const WorldInfo& world : store.Worlds()) {
        const auto found = cells.find(CellView(task.id, policy.name, policy.checkpoint, world.name));
        if (found != cells.end()) rates.push_back(RateOfCounted(found->first, found->second, confidence));
      }
    }
  }
  return rates;
}

}  // namespace evac
