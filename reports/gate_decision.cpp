#include "reports/gate_decision.h"

#include <map>

#include "core/error.h"
#include "core/hash.h"
#include "reports/estimate_json.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

Json RuleJson(const RuleDecision& rule) {
  Json json = {{"name", rule.name},           {"outcome", Name(rule.outcome)},
               {"test", rule.test},           {"metric", rule.metric},
               {"task", rule.task},           {"world", rule.world},
               {"policy", rule.policy},       {"baseline_policy", rule.baseline_policy},
               {"statement", rule.statement}, {"more", rule.more}};
  json["value"] = JsonOf(rule.value);
  json["baseline"] = JsonOf(rule.baseline);
  json["difference"] = JsonOf(rule.difference);
  Put(json, "p", rule.p);
  Put(json, "p_adjusted", rule.p_adjusted);
  json["states"] = rule.states;
  json["flips"] = {{"worse", rule.flips_worse}, {"better", rule.flips_better}};
  json["counter_examples"] = Json::array();
  for (const CounterExample& example : rule.counter_examples) {
    json["counter_examples"].push_back({{"task", example.task},
                                        {"initial_state", example.initial_state},
                                        {"seed", example.seed},
                                        {"candidate_video", example.candidate_video},
                                        {"baseline_video", example.baseline_video}});
  }
  return json;
}

Number NumberFrom(const Json& json, const std::string& key) {
  if (json.at(key).is_null()) return Undefined{json.at(key + "_reason").get<std::string>()};
  return json.at(key).get<double>();
}

Estimate EstimateFrom(const Json& json) {
  Estimate estimate;
  estimate.value = NumberFrom(json, "value");
  if (json.at("interval").is_null()) {
    estimate.interval = Undefined{json.at("interval_reason").get<std::string>()};
  } else {
    estimate.interval = Interval{json.at("interval").at(0).get<double>(), json.at("interval").at(1).get<double>()};
  }
  estimate.confidence = json.at("confidence").get<double>();
  estimate.n = json.at("n").get<std::int64_t>();
  estimate.method = json.at("method").get<std::string>();
  return estimate;
}

GateOutcome OutcomeFrom(const std::string& name) {
  for (const GateOutcome outcome : {GateOutcome::kPass, GateOutcome::kFail, GateOutcome::kInconclusive}) {
    if (name == Name(outcome)) return outcome;
  }
  throw InternalError("a stored gate decision: outcome is \"{}\", wanted pass, fail or inconclusive", name);
}

RuleDecision RuleFrom(const Json& json) {
  const auto text = [&](const char* key) { return json.at(key).get<std::string>(); };
  RuleDecision rule;
  rule.name = text("name");
  rule.test = text("test");
  rule.metric = text("metric");
  rule.task = text("task");
  rule.world = text("world");
  rule.policy = text("policy");
  rule.baseline_policy = text("baseline_policy");
  rule.outcome = OutcomeFrom(text("outcome"));
  rule.statement = text("statement");
  rule.more = text("more");
  rule.value = EstimateFrom(json.at("value"));
  rule.baseline = EstimateFrom(json.at("baseline"));
  rule.difference = EstimateFrom(json.at("difference"));
  rule.p = NumberFrom(json, "p");
  rule.p_adjusted = NumberFrom(json, "p_adjusted");
  rule.states = json.at("states").get<std::int64_t>();
  rule.flips_worse = json.at("flips").at("worse").get<std::int64_t>();
  rule.flips_better = json.at("flips").at("better").get<std::int64_t>();
  for (const Json& example : json.at("counter_examples")) {
    const auto part = [&](const char* key) { return example.at(key).get<std::string>(); };
    rule.counter_examples.push_back({part("task"), part("initial_state"), example.at("seed").get<std::uint64_t>(),
                                     part("candidate_video"), part("baseline_video")});
  }
  return rule;
}

}  // namespace

const char* Name(GateOutcome outcome) {
  switch (outcome) {
    case GateOutcome::kPass:
      return "pass";
    case GateOutcome::kFail:
      return "fail";
    case GateOutcome::kInconclusive:
      return "inconclusive";
  }
  return "inconclusive";
}

std::string GateDecision::Key() const { return Sha256Hex(rules_hash + "\n" + baseline_hash + "\n" + data_hash); }

int GravityOf(const ShownGate& gate) {
  const GateOutcome outcome = gate.decision.outcome;
  if (outcome == GateOutcome::kFail) return gate.is_current ? 4 : 3;
  if (outcome == GateOutcome::kInconclusive) return 2;
  return gate.is_current ? 0 : 1;
}

std::vector<ShownGate> LastGates(const std::vector<GateRecord>& records, const std::string& data_hash) {
  std::map<std::string, const GateRecord*> last;
  for (const GateRecord& record : records) last[record.gate] = &record;
  std::vector<ShownGate> gates;
  for (const auto& [name, record] : last) {
    ShownGate& gate = gates.emplace_back(ShownGate{GateDecisionFromJson(record->document), false});
    gate.is_current = gate.decision.data_hash == data_hash;
  }
  return gates;
}

Json JsonOf(const GateDecision& decision) {
  Json json = {{"schema", 1},
               {"name", decision.name},
               {"outcome", Name(decision.outcome)},
               {"judge", decision.judge},
               {"rules_hash", decision.rules_hash},
               {"baseline_hash", decision.baseline_hash},
               {"data_hash", decision.data_hash},
               {"sizes", decision.sizes},
               {"rules", Json::array()}};
  for (const RuleDecision& rule : decision.rules) json["rules"].push_back(RuleJson(rule));
  return json;
}

GateDecision GateDecisionFromJson(const std::string& document) {
  try {
    const Json json = Json::parse(document);
    GateDecision decision;
    decision.name = json.at("name").get<std::string>();
    decision.judge = json.value("judge", std::string());
    decision.rules_hash = json.at("rules_hash").get<std::string>();
    decision.baseline_hash = json.at("baseline_hash").get<std::string>();
    decision.data_hash = json.at("data_hash").get<std::string>();
    decision.outcome = OutcomeFrom(json.at("outcome").get<std::string>());
    decision.sizes = json.at("sizes").get<std::vector<std::string>>();
    for (const Json& rule : json.at("rules")) decision.rules.push_back(RuleFrom(rule));
    return decision;
  } catch (const Json::exception& error) {
    throw InternalError("a stored gate decision cannot be read: {}", error.what());
  }
}

}  // namespace evac
