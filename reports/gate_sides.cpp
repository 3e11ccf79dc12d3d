#include "reports/gate_sides.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "reports/counted_judges.h"

namespace evac {
namespace {

using Place = std::tuple<std::string, std::string, std::uint64_t>;  // task, initial state, seed

std::vector<std::string> Keys(const std::map<std::string, std::string>& map) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : map) keys.push_back(key);
  return keys;
}

/// The one asked for, or the only one there is.
std::string Chosen(const std::string& wanted, const std::vector<std::string>& known, const std::string& what) {
  if (wanted.empty() && known.size() == 1) return known.front();
  if (!wanted.empty() && std::ranges::find(known, wanted) != known.end()) return wanted;
  throw InvalidInput("{}: found {}, wanted one of: {}", what, wanted.empty() ? "nothing" : "'" + wanted + "'",
                     fmt::join(known, ", "));
}

std::string BaselinePolicy(const GateRule& rule, const std::string& candidate, const std::vector<std::string>& known,
                           const std::string& what) {
  const bool same_name = rule.baseline_policy.empty() && std::ranges::find(known, candidate) != known.end();
  return Chosen(same_name ? candidate : rule.baseline_policy, known, what + "baseline_policy");
}

/// @param world, policy  empty: any
GateSide SideOf(const PinnedResult& result, const GateRule& rule, const std::string& world, const std::string& policy) {
  GateSide side{policy, {}, 0, 0};
  for (const PinnedCell& cell : result.cells) {
    if ((!policy.empty() && cell.policy != policy) || (!world.empty() && cell.world != world) ||
        (!rule.task.empty() && cell.task != rule.task))
      continue;
    side.Add(cell);
  }
  return side;
}

std::set<Place> PlacesOf(const GateSide& side) {
  std::set<Place> places;
  for (const PinnedCell* cell : side.cells) {
    for (const PinnedOutcome& one : cell->outcomes) places.insert({cell->task, one.initial_state, one.seed});
  }
  return places;
}

std::string Example(const std::vector<Place>& places) {
  if (places.empty()) return "none";
  const auto& [task, state, seed] = places.front();
  return fmt::format("{} (such as {} {} seed {})", places.size(), task, state, seed);
}

/// Pairs are pairs only if both sides began alike.
void DemandSameStates(const GateSides& sides, bool may_be_part, const std::string& what) {
  const std::set<Place> candidate = PlacesOf(sides.candidate), baseline = PlacesOf(sides.baseline);
  std::vector<Place> only_candidate, only_baseline;
  std::ranges::set_difference(candidate, baseline, std::back_inserter(only_candidate));
  std::ranges::set_difference(baseline, candidate, std::back_inserter(only_baseline));
  if (only_candidate.empty() && (only_baseline.empty() || may_be_part)) return;
  throw InvalidInput(
      "{}initial states: found another list than the baseline's: {} only here, {} only there, wanted the same list (or "
      "an "
      "unpaired test: boschloo, noninferiority with paired: false)",
      what, Example(only_candidate), Example(only_baseline));
}

void DemandSame(const std::string& found, const std::string& wanted, const std::string& what) {
  if (found != wanted) throw InvalidInput("{}: found {}, wanted the baseline's, {}", what, found, wanted);
}

void DemandKnown(const std::string& name, const std::map<std::string, std::string>& of_baseline,
                 const std::string& what) {
  if (!of_baseline.contains(name))
    throw InvalidInput("{}: found '{}', which the baseline has not, wanted one of: {}", what, name,
                       fmt::join(Keys(of_baseline), ", "));
}

void DemandJudge(const std::string& judge, const PinnedResult& baseline, const std::string& what) {
  if (judge != baseline.judge)
    throw InvalidInput("{}judge: found {}, wanted the baseline's, {}: `evac gate pin --judge` pins another's verdicts",
                       what, judge, baseline.judge);
}

/// In full, where the baseline's judges are those whom the rules' names stand for.
std::string FullName(const std::string& judge, const PinnedResult& baseline) {
  std::vector<std::string> there;
  std::istringstream names(baseline.judge);
  for (std::string name; std::getline(names, name, ',');) there.push_back(name);
  std::ranges::sort(there);
  return FullJudgeNames(judge, there);
}

/// Unpaired, tasks are not kept apart: an easier one would pass for a better policy.
void DemandOneTask(const GateSide& side, const std::string& where, const std::string& what) {
  if (side.cells.size() > 1)
    throw InvalidInput("{}task: found {} tasks{}, wanted one: unpaired tasks pooled can say the opposite of each", what,
                       side.cells.size(), where);
}

/// Of what both know: a baseline of an earlier evac lacks some.
void DemandSameIfKnown(const std::string& key, const std::map<std::string, std::string>& found,
                       const std::map<std::string, std::string>& wanted, const std::string& what) {
  const auto here = found.find(key), there = wanted.find(key);
  if (here != found.end() && there != wanted.end()) DemandSame(here->second, there->second, what);
}

/// A run may have been broken off, or be one shard of several: what is not there may come.
bool IsAwaited(const GateRule& rule, const GateData& data, const std::string& world) {
  return std::ranges::any_of(data.missing, [&](const PlannedEpisodes& part) { return IsOfRule(part, rule, world); });
}

/// Those with episodes; where there is none of the one that the rule names, or none at all, those still to come too.
std::vector<std::string> PoliciesOf(const GateRule& rule, const GateData& data) {
  std::vector<std::string> known = data.candidate.Policies();
  if (!known.empty() && (rule.policy.empty() || std::ranges::find(known, rule.policy) != known.end())) return known;
  std::set<std::string> all(known.begin(), known.end());
  for (const PlannedEpisodes& part : data.missing) all.insert(PolicyLabel(part.policy, part.checkpoint));
  return {all.begin(), all.end()};
}

void DemandComparable(const GateSides& sides, const GateRule& rule, const GateData& data, const std::string& what) {
  if (!rule.ComparesPairs()) {
    DemandOneTask(sides.candidate, "", what);
    DemandOneTask(sides.baseline, " in the baseline", what);
    if (!sides.candidate.cells.empty())
      DemandSame(sides.candidate.cells.front()->task, sides.baseline.cells.front()->task, what + "task");
  }
  for (const PinnedCell* cell : sides.candidate.cells) {
    if (data.baseline->tasks.contains(cell->task))
      DemandSame(data.candidate.tasks.at(cell->task), data.baseline->tasks.at(cell->task),
                 what + "page of task " + cell->task);
    DemandSameIfKnown(cell->task, data.candidate.scenes, data.baseline->scenes,
                      what + "the page of task " + cell->task + " with all files that it names");
    DemandSameIfKnown(cell->task, data.candidate.definitions, data.baseline->definitions,
                      what + "cameras, stop rule and limits of task " + cell->task);
  }
  for (const auto& [name, value] : data.candidate.settings)
    DemandSameIfKnown(name, data.candidate.settings, data.baseline->settings, what + "the suite's " + name);
  if (!rule.ComparesPairs()) return;
  const std::string& world = sides.world;
  DemandSame(data.candidate.worlds.at(world), data.baseline->worlds.at(world), what + "profile of world " + world);
  DemandSameStates(sides, rule.test == GateTest::kSavi || IsAwaited(rule, data, world), what);
}

std::vector<Count> Values(const std::map<std::pair<std::string, std::string>, Count>& map) {
  std::vector<Count> counts;
  for (const auto& [key, count] : map) counts.push_back(count);
  return counts;
}

std::string ClipPath(const PinnedResult& result, const std::string& video) {
  return video.empty() || result.run.empty() ? video : result.run + "/" + video;
}

/// The baseline's outcomes by place.
std::map<Place, const PinnedOutcome*> ByPlace(const GateSide& side) {
  std::map<Place, const PinnedOutcome*> places;
  for (const PinnedCell* cell : side.cells) {
    for (const PinnedOutcome& one : cell->outcomes) places[{cell->task, one.initial_state, one.seed}] = &one;
  }
  return places;
}

/// Of each (task, initial state) the first seed that counts.
std::set<Place> FirstOfEachState(const std::map<Place, const PinnedOutcome*>& places) {
  std::set<Place> firsts;
  std::set<std::pair<std::string, std::string>> states;
  for (const auto& [place, one] : places) {
    const auto& [task, state, seed] = place;
    if (one->Counts() && states.insert({task, state}).second) firsts.insert(place);
  }
  return firsts;
}

void Add(bool success, Count& count) {
  ++count.trials;
  count.successes += success;
}

void Add(bool now, bool then, PairedOutcomes& outcomes) {
  ++outcomes.pairs;
  outcomes.flips.only_first += now && !then;
  outcomes.flips.only_second += !now && then;
}

}  // namespace

void GateSide::Add(const PinnedCell& cell) {
  cells.push_back(&cell);
  episodes += static_cast<std::int64_t>(cell.outcomes.size());
  errors += std::ranges::count(cell.outcomes, Outcome::kError, &PinnedOutcome::outcome);
}

bool IsOfRule(const PlannedEpisodes& part, const GateRule& rule, const std::string& world) {
  return part.world == world && (rule.task.empty() || part.task == rule.task) &&
         (rule.policy.empty() || PolicyLabel(part.policy, part.checkpoint) == rule.policy);
}

GateSides SidesOf(const GateRule& rule, const GateData& data) {
  const std::string what = fmt::format("gate rule '{}': ", rule.name);
  GateSides sides;
  sides.world = Chosen(rule.world, Keys(data.candidate.worlds), what + "world");
  const bool may_be_all = !rule.Compares() && rule.test != GateTest::kCiLower && rule.policy.empty();
  const std::string policy = may_be_all ? "" : Chosen(rule.policy, PoliciesOf(rule, data), what + "policy");
  sides.candidate = SideOf(data.candidate, rule, sides.world, policy);
  if (sides.candidate.cells.empty() && !IsAwaited(rule, data, sides.world))
    throw InvalidInput("{}found no episode of {}{} in {}, wanted some", what, policy.empty() ? "any policy" : policy,
                       rule.task.empty() ? "" : " on task '" + rule.task + "'", sides.world);
  if (!rule.Compares()) return sides;
  if (!data.baseline) throw InvalidInput("{}baseline: found none, wanted --baseline RUN or PINNED.json", what);
  DemandKnown(sides.world, data.baseline->worlds, what + "world");
  DemandJudge(data.candidate.judge, *data.baseline, what);
  const std::string other = BaselinePolicy(rule, policy, data.baseline->Policies(), what);
  sides.baseline = SideOf(*data.baseline, rule, sides.world, other);
  if (sides.baseline.cells.empty())
    throw InvalidInput("{}found no episode of {} in {} in the baseline, wanted some", what, other, sides.world);
  DemandComparable(sides, rule, data, what);
  return sides;
}

void DemandSideOf(const GateRule& rule, const std::string& judge, const PinnedResult& baseline) {
  const std::string what = fmt::format("gate rule '{}': ", rule.name);
  DemandJudge(FullName(judge, baseline), baseline, what);
  if (!rule.task.empty()) DemandKnown(rule.task, baseline.tasks, what + "task");
  const bool has_one_world = rule.world.empty() && baseline.worlds.size() == 1;
  const std::string world = has_one_world ? baseline.worlds.begin()->first : rule.world;
  if (!world.empty()) DemandKnown(world, baseline.worlds, what + "world");
  const std::vector<std::string> known = baseline.Policies();
  const bool is_open = rule.policy.empty() && rule.baseline_policy.empty() && known.size() > 1;  // as the candidate's
  const std::string policy = is_open ? "" : BaselinePolicy(rule, rule.policy, known, what);
  const GateSide side = SideOf(baseline, rule, world, policy);
  if (side.cells.empty())
    throw InvalidInput("{}found no episode of {}{}{} in the baseline, wanted some", what,
                       policy.empty() ? "any policy" : policy, rule.task.empty() ? "" : " on task '" + rule.task + "'",
                       world.empty() ? "" : " in " + world);
  if (!rule.ComparesPairs() && !world.empty() && !policy.empty()) DemandOneTask(side, " in the baseline", what);
}

GatePairs PairUp(const GateSides& sides, const GateData& data) {
  GatePairs pairs;
  std::map<std::pair<std::string, std::string>, PairedOutcomes> states;
  std::map<std::pair<std::string, std::string>, Count> candidate, baseline;
  const std::map<Place, const PinnedOutcome*> before = ByPlace(sides.baseline);
  const std::set<Place> first = FirstOfEachState(before);
  for (const auto& [place, one] : ByPlace(sides.candidate)) {
    const auto partner = before.find(place);
    if (partner == before.end() || !one->Counts() || !partner->second->Counts()) continue;
    const auto& [task, state, seed] = place;
    const bool now = one->outcome == Outcome::kSuccess, then = partner->second->outcome == Outcome::kSuccess;
    Add(now, then, states[{task, state}]);
    if (first.contains(place)) Add(now, then, pairs.one_each);
    Add(now, candidate[{task, state}]);
    Add(then, baseline[{task, state}]);
    if (!now && then && pairs.counter_examples.size() < kMostCounterExamples)
      pairs.counter_examples.push_back(
          {task, state, seed, ClipPath(data.candidate, one->video), ClipPath(*data.baseline, partner->second->video)});
  }
  for (const auto& [state, outcomes] : states) pairs.by_state.push_back(outcomes);
  pairs.all = SumOf(pairs.by_state);
  pairs.effective = EffectivePairs(pairs.by_state);
  pairs.candidate = Values(candidate);
  pairs.baseline = Values(baseline);
  return pairs;
}

std::vector<Count> CountsOf(const GateSide& side) {
  std::map<std::pair<std::string, std::string>, Count> states;
  for (const PinnedCell* cell : side.cells) {
    for (const PinnedOutcome& one : cell->outcomes) {
      if (one.Counts()) Add(one.outcome == Outcome::kSuccess, states[{cell->task, one.initial_state}]);
    }
  }
  return Values(states);
}

}  // namespace evac
