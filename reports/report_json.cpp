#include "reports/report_json.h"

#include <nlohmann/json.hpp>

#include "reports/estimate_json.h"
#include "reports/findings.h"
#include "reports/gate_data.h"
#include "reports/gate_decision.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

Json FindingsJson(const RunSummary& summary) {
  Json json = Json::array();
  for (const Finding& finding : FindingsOf(summary)) {
    json.push_back({{"decision", Name(finding.decision)}, {"question", finding.question}, {"answer", finding.answer}});
  }
  return json;
}

Json RatesJson(const RunSummary& summary) {
  Json json = Json::array();
  for (const RateCell& cell : summary.rates) {
    Json row = {{"task", cell.task}, {"policy", cell.policy}, {"world", cell.world}, {"initial_states", cell.states}};
    for (std::size_t i = 0; i < kOutcomes; ++i) row["episodes"][Name(static_cast<Outcome>(i))] = cell.counts[i];
    row["success_rate"] = JsonOf(cell.rate);
    row["letters"] = cell.letters;
    json.push_back(std::move(row));
  }
  return json;
}

Json CorrelationOf(const CorrelationGroup& group) {
  Json json = {{"group", group.group}, {"points", group.points.size()}};
  json["pearson"] = JsonOf(group.pearson);
  json["spearman"] = JsonOf(group.spearman);
  json["mmrv"] = JsonOf(group.mmrv);
  json["mmrv_convention"] = Name(group.options.convention);
  json["ties"] = group.ranks.ties;
  Put(json, "mmrv_over_range", group.ranks.over_range);
  Put(json, "bias", group.distance.bias);
  Put(json, "mae", group.distance.mae);
  json["undefined_replicates"] = group.undefined_replicates;
  return json;
}

Json PairsJson(const RunSummary& summary, const PairTable& table) {
  Json json = {{"task", table.task},
               {"policy", table.policy},
               {"both_succeed", table.both_succeed},
               {"real_only", table.real_only},
               {"other_only", table.other_only},
               {"both_fail", table.both_fail},
               {"uncounted", table.uncounted},
               {"unpaired", table.unpaired},
               {"effective_pairs", table.effective_pairs}};
  Put(json, "mcnemar_p_exact", table.Counted() > 0 ? Number(table.test.p_exact) : Undefined{"no pairs"});
  json["agreement"] = JsonOf(table.agreement);
  json["flips"] = Json::array();
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = summary.episodes[pair.real];
    const JudgedEpisode& other = summary.episodes[pair.other];
    if (!real.Counts() || !other.Counts() || real.outcome == other.outcome) continue;
    json["flips"].push_back({{"initial_state", real.episode.key.pair.initial_state},
                             {"seed", real.episode.key.pair.seed},
                             {"real", Name(real.outcome)},
                             {"other", Name(other.outcome)},
                             {"real_video", real.episode.video},
                             {"other_video", other.episode.video}});
  }
  return json;
}

Json ComparisonsJson(const RunSummary& summary) {
  Json json = Json::array();
  for (const WorldComparison& comparison : summary.comparisons) {
    Json row = {
        {"real", comparison.real}, {"other", comparison.other}, {"correlation", CorrelationOf(comparison.correlation)}};
    row["by_task"] = Json::array();
    for (const CorrelationGroup& group : comparison.by_task) row["by_task"].push_back(CorrelationOf(group));
    row["agreement"] = JsonOf(comparison.agreement);
    row["points"] = Json::array();
    for (const ComparedPoint& point : comparison.points) {
      row["points"].push_back({{"task", point.task},
                               {"policy", point.policy},
                               {"real", JsonOf(point.real)},
                               {"other", JsonOf(point.other)}});
    }
    row["pairs"] = Json::array();
    for (const PairTable& table : comparison.tables) row["pairs"].push_back(PairsJson(summary, table));
    json.push_back(std::move(row));
  }
  return json;
}

Json GatesJson(const RunSummary& summary) {
  Json json = Json::array();
  if (summary.data.gates.empty()) return json;
  for (const ShownGate& gate : LastGates(summary.data.gates, DataHash(summary.data))) {
    json.push_back(JsonOf(gate.decision));
    json.back()["current"] = gate.is_current;
  }
  return json;
}

Json EpisodeJson(const JudgedEpisode& judged) {
  const Episode& episode = judged.episode;
  return {{"id", episode.key.Id()},
          {"task", episode.key.pair.task},
          {"initial_state", episode.key.pair.initial_state},
          {"policy", episode.key.pair.policy},
          {"checkpoint", episode.key.pair.checkpoint},
          {"world", episode.key.world},
          {"seed", episode.key.pair.seed},
          {"outcome", Name(judged.outcome)},
          {"verdict_reason", judged.verdict ? Json(judged.verdict->reason) : Json(nullptr)},
          {"stop", Name(episode.stop)},
          {"stop_reason", episode.stop_reason},
          {"failure", episode.failure},
          {"video", episode.video},
          {"video_sha256", episode.video_sha256}};
}

std::string Dumped(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

/// A line each: as one document in memory, those of a large run would need ten times the file's size.
void AppendEpisodes(const RunSummary& summary, std::string& text) {
  text += "\"episodes\": [";
  const char* lead = "\n  ";
  for (const JudgedEpisode& judged : summary.episodes) {
    text += lead + Dumped(EpisodeJson(judged), -1);
    lead = ",\n  ";
  }
  text += "\n ]";
}

Json ProvenanceJson(const RunSummary& summary, const std::string& program) {
  const RunData& data = summary.data;
  Json json = {{"suite_hash", data.run.suite_hash},
               {"run_version", data.run.evac_version},
               {"report_program", program},
               {"judge", summary.options.judge},
               {"judges_in_store", summary.judges},
               {"confidence", summary.options.confidence},
               {"bootstrap_replicates", summary.options.bootstrap_replicates},
               {"bootstrap_seed", summary.options.bootstrap_seed}};
  json["worlds"] = Json::array();
  for (const WorldInfo& world : data.worlds) {
    json["worlds"].push_back(
        {{"name", world.name}, {"type", world.type}, {"is_real", world.is_real}, {"profile_hash", world.profile_hash}});
  }
  json["policies"] = Json::array();
  for (const PolicyInfo& policy : data.policies) {
    json["policies"].push_back(
        {{"name", policy.name}, {"checkpoint", policy.checkpoint}, {"declaration", policy.declaration}});
  }
  json["tasks"] = Json::array();
  for (const Task& task : data.tasks) {
    json["tasks"].push_back(
        {{"id", task.id}, {"instruction", task.instruction}, {"rubric_version", task.rubric.version}});
  }
  return json;
}

}  // namespace

std::string ReportJson(const RunSummary& summary, const std::string& program) {
  Json json = {{"schema", kReportJsonSchema}, {"findings", FindingsJson(summary)}, {"rates", RatesJson(summary)}};
  json["comparisons"] = ComparisonsJson(summary);
  json["gates"] = GatesJson(summary);
  json["counters"] = summary.data.counters;
  json["provenance"] = ProvenanceJson(summary, program);
  std::string text = Dumped(json, 1);
  text.resize(text.rfind("\n}"));
  text += ",\n ";
  AppendEpisodes(summary, text);
  return text + "\n}\n";
}

}  // namespace evac
