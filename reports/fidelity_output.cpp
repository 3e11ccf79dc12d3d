#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/statistics/bootstrap.h"
#include "reports/fidelity.h"
#include "reports/text_table.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kObjectQuantile = 0.85;

/// Numbers of one object; where one is undefined its reason is kept apart, so that readers find a number or null.
class NumberWriter {
 public:
  void Put(const std::string& key, const Number& number) {
    json_[key] = number ? Json(*number) : Json(nullptr);
    if (!number) reasons_[key] = number.reason();
  }
  void Put(const std::string& key, std::int64_t count) { json_[key] = count; }
  void Put(const std::string& key, Json value) { json_[key] = std::move(value); }
  void PutReasonsOf(const std::string& key, NumberWriter part) { json_[key] = part.Take(); }
  Json Take() {
    if (!reasons_.empty()) json_["undefined"] = reasons_;
    return std::move(json_);
  }

 private:
  Json json_ = Json::object(), reasons_ = Json::object();
};

Number LowOf(const Estimate& estimate) {
  if (!estimate.interval) return Undefined{estimate.interval.reason()};
  return estimate.interval->low;
}

Json ByChunk(const std::vector<ChunkDrift>& chunks, Number ChunkDrift::*what) {
  Json list = Json::array();
  for (const ChunkDrift& chunk : chunks) list.push_back(chunk.*what ? Json(*(chunk.*what)) : Json(nullptr));
  return list;
}

Json DriftsOf(const std::vector<ChunkDrift>& chunks) {
  Json clips = Json::array();
  for (const ChunkDrift& chunk : chunks) clips.push_back(chunk.clips);
  return {{"clips_by_chunk", clips},
          {"gripper_px_error_by_chunk", ByChunk(chunks, &ChunkDrift::gripper_px)},
          {"gripper_found_by_chunk", ByChunk(chunks, &ChunkDrift::gripper_found)},
          {"psnr_by_chunk", ByChunk(chunks, &ChunkDrift::psnr)},
          {"psnr_moving_by_chunk", ByChunk(chunks, &ChunkDrift::psnr_moving)},
          {"psnr_moving_copy_by_chunk", ByChunk(chunks, &ChunkDrift::psnr_moving_copy)}};
}

Number ObjectError(const Fidelity& fidelity) {
  const OpenLoopDrift& drift = fidelity.input.open_loop;
  if (fidelity.open.asked == 0) return Undefined{"nothing was asked"};
  if (drift.object_px.empty()) return Undefined{"the object was found in no real clip's end"};
  std::vector<double> sorted = drift.object_px;
  std::sort(sorted.begin(), sorted.end());
  return Quantile(sorted, kObjectQuantile);
}

/// n and the shares of what two columns of outcomes say.
void PutMatch(const OutcomeMatch& match, NumberWriter& writer) {
  writer.Put("n", match.n);
  writer.Put("agreement", match.agreement.value);
  writer.Put("hallucinated", match.hallucinated.value);
  writer.Put("missed", match.missed.value);
}

Json OpenLoopJson(const Fidelity& fidelity) {
  NumberWriter open;
  PutMatch(fidelity.open, open);
  open.Put("object_px_error_p85", ObjectError(fidelity));
  Json json = open.Take();
  json.update(DriftsOf(fidelity.input.open_loop.chunks));
  return json;
}

Json ExecutedJson(const Fidelity& fidelity) {
  NumberWriter writer;
  PutMatch(fidelity.executed, writer);
  writer.Put("wrong_of_actions", fidelity.wrong.of_actions);
  writer.Put("wrong_led_astray", fidelity.wrong.led_astray);
  return writer.Take();
}

Json ToldJson(const OutcomeMatch& told) {
  NumberWriter writer;
  PutMatch(told, writer);
  return writer.Take();
}

Json PartsJson(const std::vector<PartEpisodes>& parts) {
  Json list = Json::array();
  for (const PartEpisodes& part : parts)
    list.push_back({{"part", part.part}, {"episodes", part.episodes}, {"failed", part.failed}});
  return list;
}

Json CellsJson(const std::vector<FidelityCell>& cells) {
  Json list = Json::array();
  for (const FidelityCell& cell : cells) {
    NumberWriter writer;
    writer.Put("task", Json(cell.task));
    writer.Put("policy", Json(cell.policy));
    writer.Put("checkpoint", Json(cell.checkpoint));
    writer.Put("n", cell.n);
    writer.Put("n_real_real", cell.n_again);
    writer.Put("real_sr", cell.real);
    writer.Put("real2_sr", cell.again);
    writer.Put("wm_sr", cell.model);
    writer.Put("agreement", cell.agreement);
    list.push_back(writer.Take());
  }
  return list;
}

Json CounterfactualsJson(const Fidelity& fidelity) {
  Json list = Json::array();
  for (const Fidelity::Counterfactual& one : fidelity.counterfactuals) {
    NumberWriter writer;
    writer.Put("kind", Json(one.kind.substr(one.kind.find(':') + 1)));
    writer.Put("n", one.match.n);
    writer.Put("hallucinated", one.match.hallucinated.value);
    list.push_back(writer.Take());
  }
  return list;
}

Json JudgeJson(const JudgeQualityOnReal& judge) {
  NumberWriter writer;
  writer.Put("name", Json(judge.name));
  writer.Put("auroc", judge.auroc);
  writer.Put("kappa", judge.kappa.value);
  writer.Put("ece", judge.ece);
  writer.Put("kappa_masked", judge.kappa_masked);
  return writer.Take();
}

std::string Cell(const std::optional<bool>& outcome) { return !outcome ? "" : *outcome ? "1" : "0"; }

/// Quoted where a comma, a quote or a line's end asks for it.
std::string CsvText(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string Words(const Number& number) { return number ? fmt::format("{:.3f}", *number) : "–"; }

/// Pictures alone: a row per chunk.
std::string DriftText(const std::vector<ChunkDrift>& chunks) {
  std::vector<std::vector<std::string>> rows = {{"chunk", "clips", "dB", "dB of what moves", "had it stood still", "gripper px", "gripper found"}};
  for (std::size_t i = 0; i < chunks.size(); ++i)
    rows.push_back({std::to_string(i + 1), std::to_string(chunks[i].clips), Words(chunks[i].psnr), Words(chunks[i].psnr_moving),
                    Words(chunks[i].psnr_moving_copy), Words(chunks[i].gripper_px), Words(chunks[i].gripper_found)});
  return TextTable(rows);
}

}  // namespace

std::string OfOtherPairs(const FidelityCell& cell) {
  return cell.again && cell.n_again != cell.n ? fmt::format(" of {}", cell.n_again) : "";
}

std::string FidelityJson(const Fidelity& fidelity) {
  const CorrelationGroup& correlation = fidelity.model.correlation;
  NumberWriter all;
  all.Put("suite_hash", Json(fidelity.input.suite_hash));
  all.Put("model_hash", Json(fidelity.input.model_hash));
  all.Put("cells", CellsJson(fidelity.cells));
  all.Put("pearson", correlation.pearson.value);
  all.Put("pearson_low", LowOf(correlation.pearson));
  all.Put("spearman", correlation.spearman.value);
  all.Put("mmrv", fidelity.mmrv);
  all.Put("mmrv_real_real", fidelity.mmrv_again);
  all.Put("n", fidelity.closed.n);
  all.Put("n_real_real", fidelity.closed_again.n);
  all.Put("agreement", fidelity.closed.agreement.value);
  all.Put("agreement_real_real", fidelity.closed_again.agreement.value);
  all.Put("kappa", fidelity.closed.kappa.value);
  all.Put("hallucinated", fidelity.closed.hallucinated.value);
  all.Put("hallucinated_real_real", fidelity.closed_again.hallucinated.value);
  all.Put("missed", fidelity.closed.missed.value);
  all.Put("missed_real_real", fidelity.closed_again.missed.value);
  all.Put("told_real_real", ToldJson(fidelity.closed_again_told));
  all.Put("open_loop", OpenLoopJson(fidelity));
  all.Put("executed", ExecutedJson(fidelity));
  all.Put("counterfactual", CounterfactualsJson(fidelity));
  all.Put("horizon", DriftsOf(fidelity.input.horizon));
  if (fidelity.usable_horizon_chunks) {
    all.Put("usable_horizon_chunks", *fidelity.usable_horizon_chunks);
  } else {
    all.Put("usable_horizon_chunks", Undefined{"no long rollouts"});
  }
  all.Put("seconds_per_chunk", fidelity.input.seconds_per_chunk);
  all.Put("judge", JudgeJson(fidelity.input.judge));
  all.Put("parts", PartsJson(fidelity.input.parts));
  return all.Take().dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string FidelityCsv(const std::vector<FidelityRow>& rows) {
  std::string csv = "kind,task,policy,checkpoint,initial_state,seed,real_outcome,real2_outcome,wm_verdict\n";
  for (const FidelityRow& row : rows)
    csv += fmt::format("{},{},{},{},{},{},{},{},{}\n", CsvText(row.kind), CsvText(row.pair.task), CsvText(row.pair.policy),
                       CsvText(row.pair.checkpoint), CsvText(row.pair.initial_state), row.pair.seed, Cell(row.real),
                       Cell(row.again), Cell(row.model));
  return csv;
}

std::string FidelityText(const Fidelity& fidelity) {
  std::string failed;
  for (const std::string& sentence : FailedSentences(fidelity.input.parts)) failed += sentence + "\n";
  if (fidelity.cells.empty()) return DriftText(fidelity.input.open_loop.chunks) + failed;
  std::vector<std::vector<std::string>> rows = {{"task", "policy", "n", "real", "again", "model", "agreement"}};
  for (const FidelityCell& cell : fidelity.cells)
    rows.push_back({cell.task, PolicyLabel(cell.policy, cell.checkpoint), std::to_string(cell.n), Words(cell.real),
                    Words(cell.again) + OfOtherPairs(cell), Words(cell.model), Words(cell.agreement)});
  std::string text = TextTable(rows) + "\n";
  std::vector<std::vector<std::string>> whole = {{"", "n", "agreement", "hallucinated", "missed"}};
  const auto add = [&](const std::string& name, const OutcomeMatch& match) {
    whole.push_back({name, PairsText(match), Words(match.agreement.value), Words(match.hallucinated.value),
                     Words(match.missed.value)});
  };
  add("closed loop", fidelity.closed);
  add("real against real", fidelity.closed_again);
  if (HasOtherPairs(fidelity)) add("real against real, of the closed loop's pairs", fidelity.closed_again_told);
  if (fidelity.open.n > 0) add("open loop", fidelity.open);
  if (fidelity.executed.n > 0) add("executed", fidelity.executed);
  for (const Fidelity::Counterfactual& one : fidelity.counterfactuals) add(one.kind, one.match);
  text += TextTable(whole) + "\n";
  const CorrelationGroup& correlation = fidelity.model.correlation;
  text += fmt::format("Pearson {} (low {}), Spearman {}, MMRV within tasks {} (real against real {})\n", Words(correlation.pearson.value),
                      Words(LowOf(correlation.pearson)), Words(correlation.spearman.value), Words(fidelity.mmrv),
                      Words(fidelity.mmrv_again));
  return text + failed;
}

}  // namespace evac
