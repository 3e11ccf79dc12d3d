#include "reports/trust_output.h"

#include <fmt/format.h>

#include <algorithm>

#include "reports/estimate_json.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

std::string Bias(const Estimate& bias) {
  if (!bias.value) return "bias undefined: " + bias.value.reason();
  return fmt::format("bias {} points [{}, {}]", SignedPoints(*bias.value), SignedPoints(bias.interval->low),
                     SignedPoints(bias.interval->high));
}

std::string Evidence(const TaskTrust& task) {
  if (task.pairs.n() == 0) return "no initial state was tried in both worlds";
  return fmt::format("{}: {} against {} real, {}", Counted(task.pairs.n(), "pair"), Percent(*task.model.value),
                     Percent(*task.real.value), Bias(task.bias));
}

std::string AgreementLine(const TaskTrust& task) {
  if (task.pairs.n() == 0) return "";
  return fmt::format(
      "  per state: same outcome in {} of {}, kappa {}; flips {} model only / {} real only, {} {}\n",
      task.pairs.both + task.pairs.neither, task.pairs.n(), NumberWithInterval(task.agreement.kappa),
      task.pairs.only_model, task.pairs.only_real, OnPairs("exact McNemar", {task.pairs.n(), task.tested_pairs}),
      PValue(task.test.p_exact));
}

std::string CorrelationLine(const TaskTrust& task) {
  if (!task.correlation.value && task.correlation.n < static_cast<std::int64_t>(kMinTrustPolicies)) {
    return fmt::format(
        "  correlation: over {} it would mean nothing (wanted {} or more); the agreement per state stands for it\n",
        Counted(task.correlation.n, "policy", "policies"), kMinTrustPolicies);
  }
  const std::string dropped = fmt::format(", {} without one dropped", Counted(task.undefined_replicates, "replicate"));
  return fmt::format("  correlation over {}: Pearson {}{}\n", Counted(task.correlation.n, "policy", "policies"),
                     NumberWithInterval(task.correlation),
                     task.undefined_replicates > 0 && task.correlation.interval ? dropped : "");
}

/// What is made of a rate and a difference may lie outside [0, 1], unlike its interval.
Number AsShare(const Number& value) { return value ? Number(std::clamp(*value, 0.0, 1.0)) : value; }

Estimate AsShare(Estimate estimate) {
  estimate.value = AsShare(estimate.value);
  return estimate;
}

std::string Tuned(const PredictedRate& rate) {
  if (!rate.tuned.value || rate.further.trials == 0) return "-";
  return fmt::format("{} (weight {:.2f})", Percent(*AsShare(rate.tuned.value)), rate.tuned.lambda);
}

std::string Predicted(const PredictedRate& rate) {
  if (!rate.predicted.value) return "as real alone: " + rate.predicted.value.reason();
  return PercentWithInterval(AsShare(rate.predicted));
}

std::string RatesTable(const TaskTrust& task) {
  std::vector<std::vector<std::string>> rows{
      {"  POLICY", "REAL ALONE", "N", "PAIRS", "FURTHER IMAGINED", "REAL, FROM BOTH", "PPI++ ESTIMATE"}};
  for (const PredictedRate& rate : task.policies) {
    rows.push_back({"  " + rate.policy, PercentWithInterval(rate.real), std::to_string(rate.real.n),
                    std::to_string(rate.pairs.n()),
                    fmt::format("{} of {}", rate.further.successes, rate.further.trials), Predicted(rate),
                    Tuned(rate)});
  }
  return TextTable(rows);
}

Json PolicyJson(const PredictedRate& rate) {
  Json json = {{"policy", rate.policy}};
  json["pairs"] = {{"both", rate.pairs.both},
                   {"real_only", rate.pairs.only_real},
                   {"model_only", rate.pairs.only_model},
                   {"neither", rate.pairs.neither}};
  json["further_imagined"] = {{"successes", rate.further.successes}, {"trials", rate.further.trials}};
  json["real_without_partner"] = rate.real_alone;
  json["real"] = JsonOf(rate.real);
  json["model"] = JsonOf(rate.model);
  json["predicted"] = JsonOf(AsShare(rate.predicted));
  json["predicted_by_betting"] = JsonOf(AsShare(rate.betting));
  Put(json, "ppi_plus_plus", AsShare(rate.tuned.value));
  json["ppi_plus_plus_weight"] = rate.tuned.lambda;
  json["ppi_plus_plus_interval"] =
      rate.tuned.allowed ? Json::array({rate.tuned.allowed->low, rate.tuned.allowed->high}) : Json(nullptr);
  if (!rate.tuned.allowed) json["ppi_plus_plus_interval_reason"] = rate.tuned.allowed.reason();
  return json;
}

Json TaskJson(const TaskTrust& task, const TrustReport& report) {
  Json json = {{"task", task.task}, {"trust", Name(task.trust)}, {"statement", TrustStatement(task, report)}};
  json["n"] = task.pairs.n();
  json["effective_pairs"] = task.effective_pairs;
  json["pairs"] = {{"both", task.pairs.both},
                   {"real_only", task.pairs.only_real},
                   {"model_only", task.pairs.only_model},
                   {"neither", task.pairs.neither}};
  json["real"] = JsonOf(task.real);
  json["model"] = JsonOf(task.model);
  json["bias"] = JsonOf(task.bias);
  json["same_outcome"] = JsonOf(task.same);
  json["kappa"] = JsonOf(task.agreement.kappa);
  Put(json, "mcnemar_p_exact", task.pairs.n() > 0 ? Number(task.test.p_exact) : Undefined{"no pairs"});
  json["pearson"] = JsonOf(task.correlation);
  json["undefined_replicates"] = task.undefined_replicates;
  json["more_pairs"] = task.more ? Json(*task.more) : Json(nullptr);
  if (!task.more) json["more_pairs_reason"] = task.more.reason();
  json["policies"] = Json::array();
  for (const PredictedRate& rate : task.policies) json["policies"].push_back(PolicyJson(rate));
  return json;
}

}  // namespace

std::string TrustStatement(const TaskTrust& task, const TrustReport& report) {
  const std::string margin = "±" + GivenPoints(report.options.margin), evidence = Evidence(task);
  switch (task.trust) {
    case Trust::kYes:
      return fmt::format("yes: {}'s rate is within {} of the real one ({})", report.world, margin, evidence);
    case Trust::kNo:
      return fmt::format("no: {}'s rate is further than {} from the real one ({})", report.world, margin, evidence);
    case Trust::kUnknown:
      return fmt::format("unknown: {}; {}", evidence,
                         task.more ? fmt::format("about {} would decide on {}", Counted(*task.more, "more pair"), margin)
                                   : "no number of pairs can be named: " + task.more.reason());
  }
  return "";
}

std::string TrustText(const TrustReport& report) {
  std::string text =
      fmt::format("May {} be trusted? Held against {}; judge {}.\n", report.world, report.real, report.judge);
  for (const TaskTrust& task : report.tasks) {
    text += fmt::format("\n{}: {}.\n{}{}{}", task.task, TrustStatement(task, report), AgreementLine(task),
                        CorrelationLine(task), RatesTable(task));
  }
  return text;
}

nlohmann::ordered_json TrustJson(const TrustReport& report) {
  Json json = {{"world", report.world},
               {"real", report.real},
               {"judge", report.judge},
               {"confidence", report.options.confidence},
               {"margin", report.options.margin},
               {"bootstrap_replicates", report.options.bootstrap.replicates},
               {"bootstrap_seed", report.options.bootstrap.seed}};
  json["tasks"] = Json::array();
  for (const TaskTrust& task : report.tasks) json["tasks"].push_back(TaskJson(task, report));
  return json;
}

}  // namespace evac
