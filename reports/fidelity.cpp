#include "reports/fidelity.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "core/statistics/confusion.h"
#include "core/statistics/rates.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kGain_db = 2;  ///< over a still picture, for a chunk to be of use
constexpr const char* kReal = "real";

/// Outcomes of rows that have one in both columns.
ConfusionByState ConfusionsOf(const std::vector<FidelityRow>& rows, const std::string& kind, FidelityColumn column) {
  ConfusionByState states;
  for (const FidelityRow& row : rows) {
    const std::optional<bool>& said = column == FidelityColumn::kAgain ? row.again : row.model;
    if (row.kind != kind || !row.real || !said) continue;
    states[{row.pair.task, row.pair.initial_state}].Add(*said, *row.real);
  }
  return states;
}

/// How many there are of some items, in each state.
std::vector<Count> CountsOf(const ConfusionByState& states, const std::function<Count(const Confusion&)>& of) {
  std::vector<Count> counts;
  for (const auto& [state, confusion] : states) counts.push_back(of(confusion));
  return counts;
}

/// Of whose imagined clip the judge could tell how it ended.
std::vector<FidelityRow> ToldOf(std::vector<FidelityRow> rows) {
  std::erase_if(rows, [](const FidelityRow& row) { return !row.model; });
  return rows;
}

/// The episode as `Compare` counts it.
JudgedEpisode Judged(const PairKey& pair, const std::string& world, const std::optional<bool>& success) {
  JudgedEpisode judged;
  judged.episode.key = {pair, world};
  judged.episode.stop = StopReason::kStill;
  judged.outcome = !success ? Outcome::kCannotTell : *success ? Outcome::kSuccess : Outcome::kFailure;
  return judged;
}

WorldComparison CompareColumn(const std::vector<FidelityRow>& rows, FidelityColumn column) {
  const bool is_model = column == FidelityColumn::kModel;
  ComparedWorlds worlds{kReal, is_model ? "world model" : "real again", {}, {}};
  std::vector<JudgedEpisode> episodes;
  const auto name_once = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const FidelityRow& row : rows) {
    if (row.kind != "closed_loop") continue;
    name_once(worlds.tasks, row.pair.task);
    name_once(worlds.policies, PolicyLabel(row.pair.policy, row.pair.checkpoint));
    episodes.push_back(Judged(row.pair, kReal, row.real));
    episodes.push_back(Judged(row.pair, worlds.other, is_model ? row.model : row.again));
  }
  return Compare(episodes, worlds, {});
}

/// The mean over the tasks in which it is defined.
Number MeanMmrv(const WorldComparison& comparison) {
  double sum = 0;
  int tasks = 0;
  std::string reason = "no task has two policies";
  const auto& groups = comparison.by_task;
  for (const CorrelationGroup& group : groups) {
    if (group.mmrv.value) {
      sum += *group.mmrv.value;
      ++tasks;
    } else {
      reason = group.mmrv.value.reason();
    }
  }
  if (groups.empty()) return comparison.correlation.mmrv.value;
  if (tasks == 0) return Undefined{reason};
  return sum / tasks;
}

struct CellCounts {
  std::int64_t n = 0, real = 0, model = 0, agree = 0, both = 0, again = 0;
};

std::vector<FidelityCell> CellsOf(const std::vector<FidelityRow>& rows) {
  std::map<std::tuple<std::string, std::string, std::string>, CellCounts> counts;
  for (const FidelityRow& row : rows) {
    if (row.kind != "closed_loop") continue;
    CellCounts& cell = counts[{row.pair.task, row.pair.policy, row.pair.checkpoint}];
    if (row.real && row.model) {
      ++cell.n;
      cell.real += *row.real;
      cell.model += *row.model;
      cell.agree += *row.real == *row.model;
    }
    if (row.real && row.again) {
      ++cell.both;
      cell.again += *row.again;
    }
  }
  std::vector<FidelityCell> cells;
  const auto share = [](std::int64_t count, std::int64_t of) -> Number {
    if (of == 0) return Undefined{"no pairs"};
    return static_cast<double>(count) / static_cast<double>(of);
  };
  for (const auto& [key, cell] : counts) {
    const auto& [task, policy, checkpoint] = key;
    cells.push_back({task, policy, checkpoint, cell.n, cell.both, share(cell.real, cell.n), share(cell.again, cell.both),
                     share(cell.model, cell.n), share(cell.agree, cell.n)});
  }
  return cells;
}

Fidelity::WrongOutcomes WrongOutcomesOf(const std::vector<FidelityRow>& rows) {
  std::map<PairKey, bool> come_to;
  for (const FidelityRow& row : rows) {
    if (row.kind == "executed" && row.real) come_to[row.pair] = *row.real;
  }
  Fidelity::WrongOutcomes wrong;
  for (const FidelityRow& row : rows) {
    if (row.kind != "closed_loop" || !row.real || !row.model || *row.real == *row.model) continue;
    const auto found = come_to.find(row.pair);
    if (found != come_to.end()) ++(found->second == *row.model ? wrong.led_astray : wrong.of_actions);
  }
  return wrong;
}

std::optional<std::int64_t> UsableHorizon(const std::vector<ChunkDrift>& chunks) {
  if (chunks.empty()) return std::nullopt;
  std::int64_t usable = 0;
  for (const ChunkDrift& chunk : chunks) {
    const bool moved = static_cast<bool>(chunk.psnr_moving) && static_cast<bool>(chunk.psnr_moving_copy);
    if (moved && *chunk.psnr_moving < *chunk.psnr_moving_copy + kGain_db) break;
    ++usable;
  }
  return usable;
}

}  // namespace

OutcomeMatch MatchOf(const std::vector<FidelityRow>& rows, const std::string& kind, FidelityColumn column) {
  const ConfusionByState states = ConfusionsOf(rows, kind, column);
  OutcomeMatch match;
  match.asked = std::ranges::count(rows, kind, &FidelityRow::kind);
  match.n = SumOf(states).total();
  const auto rate = [&](const std::function<Count(const Confusion&)>& of, const char* none) {
    const std::vector<Count> counts = CountsOf(states, of);
    if (SumOf(counts).trials > 0) return ClusteredWilsonInterval(counts);
    const Undefined why{match.asked == 0 ? "nothing was asked" : match.n == 0 ? "no pairs" : none};
    Estimate estimate;
    estimate.value = why;
    estimate.interval = why;
    return estimate;
  };
  match.agreement = rate([](const Confusion& c) { return Count{c.both_success + c.both_failure, c.total()}; }, "no pairs");
  match.hallucinated = rate(
      [](const Confusion& c) { return Count{c.only_judge_success, c.only_judge_success + c.both_failure}; },
      "nothing truly failed");
  match.missed = rate(
      [](const Confusion& c) { return Count{c.only_human_success, c.only_human_success + c.both_success}; },
      "nothing truly succeeded");
  match.kappa = StatisticsByState(states).kappa;
  return match;
}

std::vector<std::string> FailedSentences(const std::vector<PartEpisodes>& parts) {
  std::vector<std::string> sentences;
  for (const PartEpisodes& part : parts) {
    if (part.failed > 0)
      sentences.push_back(fmt::format("{}: {} of {} failed and {} in no number; the last: {}", part.part, part.failed,
                                      Counted(part.episodes, "episode"), part.failed == 1 ? "is" : "are", part.last_failure));
  }
  return sentences;
}

bool HasOtherPairs(const Fidelity& fidelity) {
  return fidelity.closed.n > 0 && fidelity.closed_again.n != fidelity.closed_again_told.n;
}

std::string PairsText(const OutcomeMatch& match) {
  return match.n == match.asked ? fmt::format("{}", match.n) : fmt::format("{} of {}", match.n, match.asked);
}

Fidelity FidelityOf(FidelityInput input) {
  Fidelity fidelity;
  fidelity.cells = CellsOf(input.rows);
  fidelity.model = CompareColumn(input.rows, FidelityColumn::kModel);
  fidelity.again = CompareColumn(input.rows, FidelityColumn::kAgain);
  fidelity.mmrv = MeanMmrv(fidelity.model);
  fidelity.mmrv_again = MeanMmrv(fidelity.again);
  fidelity.closed = MatchOf(input.rows, "closed_loop", FidelityColumn::kModel);
  fidelity.closed_again = MatchOf(input.rows, "closed_loop", FidelityColumn::kAgain);
  fidelity.closed_again_told = MatchOf(ToldOf(input.rows), "closed_loop", FidelityColumn::kAgain);
  fidelity.open = MatchOf(input.rows, "open_loop", FidelityColumn::kModel);
  fidelity.executed = MatchOf(input.rows, "executed", FidelityColumn::kModel);
  fidelity.wrong = WrongOutcomesOf(input.rows);
  std::set<std::string> kinds;
  for (const FidelityRow& row : input.rows) {
    if (row.kind.starts_with("counterfactual:")) kinds.insert(row.kind);
  }
  for (const std::string& kind : kinds)
    fidelity.counterfactuals.push_back({kind, MatchOf(input.rows, kind, FidelityColumn::kModel)});
  fidelity.usable_horizon_chunks = UsableHorizon(input.horizon);
  fidelity.input = std::move(input);
  return fidelity;
}

}  // namespace evac
