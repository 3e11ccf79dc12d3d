#include "reports/gate_rules.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "core/hash.h"

namespace evac {
namespace {

constexpr std::array kTests = {GateTest::kPairedMcnemar,  GateTest::kBoschloo,  GateTest::kSavi,
                               GateTest::kNonInferiority, GateTest::kCiLower,   GateTest::kCorrelation,
                               GateTest::kJudgeKappa,     GateTest::kErrorShare};

/// The metrics that a test can be about; the first is meant where none is named.
std::vector<std::string> MetricsOf(GateTest test) {
  switch (test) {
    case GateTest::kCorrelation:
      return {"pearson", "spearman", "mmrv"};
    case GateTest::kJudgeKappa:
      return {"kappa"};
    case GateTest::kErrorShare:
      return {"error_share"};
    default:
      return {"success_rate"};
  }
}

std::string Choice(const Config& page, const std::string& key, const std::vector<std::string>& known,
                   const std::string& otherwise) {
  const std::string found = page.Get<std::string>(key, otherwise);
  page.Require(std::ranges::find(known, found) != known.end(), key, fmt::format("{}", fmt::join(known, ", ")));
  return found;
}

GateTest TestOf(const Config& page) {
  std::vector<std::string> names;
  for (const GateTest test : kTests) names.emplace_back(Name(test));
  const std::string name = Choice(page, "test", names, page.Get<std::string>("test"));
  return kTests.at(static_cast<std::size_t>(std::ranges::find(names, name) - names.begin()));
}

double Inside(const Config& page, const std::string& key, double otherwise, double below) {
  const double value = page.Get<double>(key, otherwise);
  page.Require(!page.Has(key) || (value > 0 && value < below), key,
               fmt::format("a number above 0 and below {:g}", below));
  return value;
}

/// A threshold that a test needs, or must not have.
std::optional<double> Threshold(const Config& page, const std::string& key, bool is_needed) {
  if (!is_needed) {
    page.Require(!page.Has(key), key, "none: this test has no use for it");
    return std::nullopt;
  }
  const double value = page.Get<double>(key);
  page.Require(value >= -1 && value <= 1, key, "a number from -1 to 1");
  return value;
}

OnInconclusive OnInconclusiveOf(const Config& page, const std::string& otherwise) {
  return Choice(page, "on_inconclusive", {"warn", "fail"}, otherwise) == "fail" ? OnInconclusive::kFail
                                                                                : OnInconclusive::kWarn;
}

/// What the top of the file sets for every rule.
struct Defaults {
  double alpha = 0.05;
  std::string on_inconclusive = "warn";
};

GateRule RuleOf(const Config& page, const Defaults& defaults) {
  page.AllowOnly({"name", "test", "metric", "task", "world", "policy", "baseline_policy", "against", "paired", "alpha",
                  "margin", "at_least", "at_most", "min_states", "max_error_share", "on_inconclusive"});
  GateRule rule;
  rule.name = page.Get<std::string>("name");
  page.Require(!rule.name.empty(), "name", "a text that is not empty");
  rule.test = TestOf(page);
  rule.metric = Choice(page, "metric", MetricsOf(rule.test), MetricsOf(rule.test).front());
  for (const auto& [key, field] : {std::pair{"task", &GateRule::task},
                                   {"world", &GateRule::world},
                                   {"policy", &GateRule::policy},
                                   {"baseline_policy", &GateRule::baseline_policy}})
    rule.*field = page.Get<std::string>(key, "");
  page.Require(rule.policy.empty() || rule.test != GateTest::kCorrelation, "policy",
               "none: a correlation is over all policies");
  page.Require(rule.baseline_policy.empty() || rule.Compares(), "baseline_policy", "none: this test has no use for it");
  page.Require(!page.Has("against") || rule.test == GateTest::kJudgeKappa, "against",
               "none: only judge_kappa has another judge");
  rule.against = page.Get<std::string>("against", rule.against);
  rule.is_paired = page.Get<bool>("paired", rule.test != GateTest::kBoschloo);
  page.Require(!page.Has("paired") || rule.test == GateTest::kNonInferiority, "paired",
               "none: only noninferiority can be either");
  rule.alpha = Inside(page, "alpha", defaults.alpha, 0.5);
  rule.margin = Inside(page, "margin", rule.margin, 1);
  page.Require(!page.Has("margin") || rule.Compares(), "margin", "none: this test has no use for it");
  const bool is_ceiling = rule.metric == "mmrv" || rule.test == GateTest::kErrorShare;
  rule.at_least = Threshold(page, "at_least", !rule.Compares() && !is_ceiling);
  rule.at_most = Threshold(page, "at_most", is_ceiling);
  rule.min_states = page.Get<int>("min_states", rule.min_states);
  page.Require(rule.min_states >= 0, "min_states", "a whole number, 0 or more");
  rule.max_error_share = page.Get<double>("max_error_share", rule.max_error_share);
  page.Require(rule.max_error_share >= 0 && rule.max_error_share <= 1, "max_error_share", "a number from 0 to 1");
  rule.on_inconclusive = OnInconclusiveOf(page, defaults.on_inconclusive);
  return rule;
}

}  // namespace

const char* Name(GateTest test) {
  static constexpr std::array<const char*, 8> kNames = {
      "paired_mcnemar", "boschloo", "savi", "noninferiority", "ci_lower", "correlation", "judge_kappa", "error_share"};
  return kNames.at(static_cast<std::size_t>(test));
}

bool GateRule::Compares() const {
  return test == GateTest::kPairedMcnemar || test == GateTest::kBoschloo || test == GateTest::kSavi ||
         test == GateTest::kNonInferiority;
}

bool GateRule::ComparesPairs() const { return Compares() && is_paired; }

GateRules ReadGateRules(const Config& page) {
  page.AllowOnly({"name", "judge", "correction", "alpha", "on_inconclusive", "gates"});
  GateRules rules;
  rules.name = page.Get<std::string>("name", page.file().stem().string());
  page.Require(!page.Has("name") || !rules.name.empty(), "name", "a text that is not empty");
  rules.judge = page.Get<std::string>("judge", rules.judge);
  rules.correction =
      Choice(page, "correction", {"holm", "none"}, "holm") == "holm" ? GateCorrection::kHolm : GateCorrection::kNone;
  Defaults defaults;
  defaults.alpha = Inside(page, "alpha", defaults.alpha, 0.5);
  OnInconclusiveOf(page, defaults.on_inconclusive);  // complains
  defaults.on_inconclusive = page.Get<std::string>("on_inconclusive", defaults.on_inconclusive);
  for (const Config& item : page.List("gates")) {
    if (!item.node().IsMap())
      throw InvalidInput("{}: found no rule, wanted a mapping with name and test", item.Where());
    rules.rules.push_back(RuleOf(item, defaults));
    const auto& name = rules.rules.back().name;
    item.Require(std::ranges::count(rules.rules, name, &GateRule::name) == 1, "name", "a name that no other rule has");
  }
  if (rules.rules.empty())
    throw InvalidInput("{}: field gates: found no rule, wanted at least one", page.file().string());
  // The name that decisions are kept under is among what a file means, also where it is only called so.
  rules.hash = page.Has("name") ? page.ContentHash() : Sha256Hex(page.ContentHash() + "\n" + rules.name);
  return rules;
}

}  // namespace evac
