#include "reports/verdicts_csv.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "reports/csv.h"

namespace evac {
namespace {

constexpr std::size_t kTypicalRowBytes = 300;

std::vector<std::string> RowOf(const Episode& episode, const Verdict& verdict) {
  const PairKey& pair = episode.key.pair;
  const nlohmann::json stages = verdict.stages;
  return {episode.key.Id(),
          pair.task,
          pair.initial_state,
          pair.policy,
          pair.checkpoint,
          episode.key.world,
          std::to_string(pair.seed),
          Name(episode.stop),
          IsFailure(episode.stop) ? "1" : "0",
          verdict.judge,
          verdict.judge.empty() ? "" : Name(verdict.label),
          verdict.probability ? fmt::format("{}", *verdict.probability) : "",
          verdict.stages.empty() ? "" : stages.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
          verdict.reason,
          verdict.rubric_version,
          episode.video};
}

}  // namespace

std::string VerdictsCsv(const RunSummary& summary) {
  std::string csv = CsvLine({"episode", "task", "initial_state", "policy", "checkpoint", "world", "seed", "stop",
                             "failed", "judge", "label", "probability", "stages", "reason", "rubric_version", "video"});
  csv.reserve(csv.size() + summary.data.episodes.size() * kTypicalRowBytes);
  for (const Episode& episode : summary.data.episodes) {
    const auto verdicts = summary.data.verdicts.find(episode.key.Id());
    if (verdicts == summary.data.verdicts.end()) {
      csv += CsvLine(RowOf(episode, Verdict{}));
      continue;
    }
    for (const auto& [judge, verdict] : verdicts->second) csv += CsvLine(RowOf(episode, verdict));
  }
  return csv;
}

}  // namespace evac
