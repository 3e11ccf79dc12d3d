#include "reports/report_json.h"

#include <nlohmann/json.hpp>

#include "reports/estimate_json.h"
#include "reports/findings.h"
#include "reports/headlines.h"
#include "reports/methods.h"
#include "reports/policy_comparison_output.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

Json HeadlinesJson(const ReportData& report) {
  Json json = Json::array();
  for (const Headline& headline : HeadlinesOf(report)) {
    Json items = Json::array();
    for (const HeadlineItem& item : headline.items) items.push_back({{"tag", item.tag}, {"text", item.text}});
    json.push_back({{"question", headline.question}, {"answers", std::move(items)}});
  }
  return json;
}

Json FindingsJson(const RunSummary& summary) {
  Json json = Json::array();
  for (const Finding& finding : FindingsOf(summary)) {
    json.push_back({{"decision", Name(finding.decision)}, {"question", finding.question}, {"answer", finding.answer}});
  }
  return json;
}

Json RatesJson(const std::vector<RateCell>& rates) {
  Json json = Json::array();
  for (const RateCell& cell : rates) {
    Json row = {{"task", cell.task}, {"policy", cell.policy}, {"world", cell.world}, {"initial_states", cell.states}};
    for (std::size_t i = 0; i < kOutcomes; ++i) row["episodes"][Name(static_cast<Outcome>(i))] = cell.counts[i];
    row["success_rate"] = JsonOf(cell.rate);
    row["letters"] = cell.letters;
    json.push_back(std::move(row));
  }
  return json;
}

/// p over all candidates, as the page has it; who wins by one comparison's own step is not said beside it.
Json AmongCandidates(const ComparisonRow& row, const Number& p_holm) {
  Json json = JsonOf(row);
  for (const char* key : {"p_holm", "p_holm_reason", "winner", "more", "more_reason"}) json.erase(key);
  Put(json, "p_holm", p_holm);
  return json;
}

Json CandidatesJson(const ReportData& report) {
  Json json = Json::array();
  for (const Candidate& candidate : report.candidates) {
    const PolicyComparison& comparison = candidate.comparison;
    Json row = {{"policy", comparison.first}, {"baseline", comparison.second}, {"world", report.world}};
    row["tasks"] = Json::array();
    for (std::size_t i = 0; i < comparison.tasks.size(); ++i)
      row["tasks"].push_back(AmongCandidates(comparison.tasks[i], candidate.task_p_holm[i]));
    row["all_tasks"] = AmongCandidates(comparison.all, candidate.p_holm);
    row["all_tasks"]["left_out"] = comparison.left_out;
    row["all_tasks"]["more"] = candidate.more ? Json(*candidate.more) : Json(nullptr);
    if (!candidate.more) row["all_tasks"]["more_reason"] = candidate.more.reason();
    json.push_back(std::move(row));
  }
  return json;
}

Json StagesJson(const StageReport& stages) {
  Json json = {{"episodes", stages.episodes}, {"funnels", Json::array()}, {"partings", Json::array()}};
  for (const StageFunnel& funnel : stages.funnels) {
    Json row = {{"task", funnel.task}, {"policy", funnel.policy}, {"stages", funnel.stages}, {"worlds", Json::array()}};
    for (const StageRow& world : funnel.worlds) {
      Json reached = Json::array();
      for (const Estimate& share : world.reached) reached.push_back(JsonOf(share));
      row["worlds"].push_back({{"world", world.world}, {"reached", std::move(reached)}});
    }
    json["funnels"].push_back(std::move(row));
  }
  for (const StageParting& parting : stages.partings) {
    Json row = {{"task", parting.task},
                {"stage", parting.stage},
                {"world", parting.world},
                {"pairs", parting.pairs},
                {"effective_pairs", parting.effective_pairs},
                {"other_only", parting.flips.only_first},
                {"real_only", parting.flips.only_second}};
    Put(row, "p", parting.p);
    Put(row, "p_holm", parting.p_holm);
    json["partings"].push_back(std::move(row));
  }
  return json;
}

Json CheckpointsJson(const std::vector<CheckpointCurve>& curves) {
  Json json = Json::array();
  for (const CheckpointCurve& curve : curves) {
    Json row = {{"task", curve.task}, {"policy", curve.policy}, {"worlds", curve.worlds}, {"points", Json::array()}};
    for (const CheckpointPoint& point : curve.points) {
      Json rates = Json::array();
      for (const Estimate& rate : point.rate) rates.push_back(JsonOf(rate));
      row["points"].push_back({{"checkpoint", point.checkpoint}, {"step", point.step}, {"rates", std::move(rates)}});
    }
    row["steps_are_named"] = curve.has_steps;
    row["last_against_first"] = Json::array();
    for (const auto& ends : curve.ends) row["last_against_first"].push_back(ends ? JsonOf(ends->all) : Json(nullptr));
    json.push_back(std::move(row));
  }
  return json;
}

Json AgreementJson(const JudgeAgreement& judge) {
  Json json = {{"judge", judge.judge},
               {"against", judge.against},
               {"world", judge.world},
               {"judged", judge.judged},
               {"compared", judge.confusion.total()},
               {"apart", judge.apart},
               {"both_success", judge.confusion.both_success},
               {"only_judge_success", judge.confusion.only_judge_success},
               {"only_other_success", judge.confusion.only_human_success},
               {"both_failure", judge.confusion.both_failure}};
  if (!judge.IsCalibrated()) return json;
  json["kappa"] = JsonOf(judge.statistics.kappa);
  json["kinder_by"] = JsonOf(judge.bias);
  json["sensitivity"] = JsonOf(judge.statistics.sensitivity);
  json["specificity"] = JsonOf(judge.statistics.specificity);
  if (!judge.calibration.ece) return json;
  json["brier"] = JsonOf(judge.calibration.brier);
  json["ece"] = *judge.calibration.ece;
  return json;
}

Json JudgesJson(const ReportData& report) {
  const JudgeReport& judges = report.judges;
  Json json = {{"agreement", Json::array()}, {"raters", judges.raters}, {"rated_twice", judges.rated_twice}};
  Put(json, "raters_alpha", judges.alpha);
  for (const JudgeAgreement& judge : judges.judges) json["agreement"].push_back(AgreementJson(judge));
  json["rates_by_other_judges"] = Json::array();
  for (const JudgeRates& other : report.by_judge)
    json["rates_by_other_judges"].push_back({{"judge", other.judge}, {"rates", RatesJson(other.rates)}});
  json["model_server_calls"] = Json::array();
  for (const CallTotals& totals : report.summary.data.judge_calls) {
    json["model_server_calls"].push_back({{"judge", totals.judge},
                                          {"calls", totals.calls},
                                          {"requests", totals.attempts},
                                          {"prompt_tokens", totals.prompt_tokens},
                                          {"completion_tokens", totals.completion_tokens},
                                          {"waited_s", static_cast<double>(totals.latency_ms) / 1000}});
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

Json GatesJson(const std::vector<ShownGate>& gates) {
  Json json = Json::array();
  for (const ShownGate& gate : gates) {
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

std::string ReportJson(const ReportData& report, const std::string& program) {
  const RunSummary& summary = report.summary;
  Json json = {{"schema", kReportJsonSchema}, {"in_short", HeadlinesJson(report)}, {"findings", FindingsJson(summary)}};
  json["rates"] = RatesJson(summary.rates);
  json["candidates"] = CandidatesJson(report);
  json["trust"] = TrustJson(WorldsTrust{report.trust, report.unsaid});
  json["comparisons"] = ComparisonsJson(summary);
  json["stages"] = StagesJson(report.stages);
  json["checkpoints"] = CheckpointsJson(report.checkpoints);
  json["judges"] = JudgesJson(report);
  json["gates"] = GatesJson(report.gates);
  json["methods"] = MethodsParagraph(report);
  json["counters"] = summary.data.counters;
  json["provenance"] = ProvenanceJson(summary, program);
  std::string text = Dumped(json, 1);
  text.resize(text.rfind("\n}"));
  text += ",\n ";
  AppendEpisodes(summary, text);
  return text + "\n}\n";
}

std::string ReportJson(const RunSummary& summary, const std::string& program) {
  return ReportJson(ReportDataOf(summary), program);
}

}  // namespace evac
