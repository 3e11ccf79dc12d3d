#include "reports/gate.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/run_extent.h"
#include "core/statistics/many_comparisons.h"
#include "core/statistics/planning.h"
#include "core/statistics/sequential_planning.h"
#include "reports/gate_evidence.h"
#include "reports/gate_sides.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kSupposedFlips = 0.2;  // share of states, where nothing is known yet
constexpr double kSupposedRate = 0.7;
constexpr double kPower = 0.8;  // of the sizes

/// Adjusts the p-values of all rules that test something and may be decided.
void Correct(GateCorrection correction, std::vector<Evidence>& evidences) {
  std::vector<double> p_values;
  for (const Evidence& evidence : evidences) {
    if (evidence.blocked.empty() && evidence.decision.p) p_values.push_back(*evidence.decision.p);
  }
  const std::vector<double> adjusted = correction == GateCorrection::kHolm ? HolmAdjusted(p_values) : p_values;
  auto next = adjusted.begin();
  for (Evidence& evidence : evidences) {
    Number& p = evidence.decision.p_adjusted;
    if (!evidence.decision.p) {
      p = Undefined{evidence.decision.p.reason()};
    } else if (evidence.blocked.empty()) {
      p = *next++;
    } else {
      p = Undefined{evidence.blocked};
    }
  }
}

GateOutcome OutcomeOf(const GateRule& rule, const Evidence& evidence) {
  if (!evidence.blocked.empty()) return GateOutcome::kInconclusive;
  if (evidence.counted) return *evidence.counted;
  if (evidence.decision.p_adjusted && *evidence.decision.p_adjusted <= rule.alpha) return GateOutcome::kFail;
  return evidence.shows_good ? GateOutcome::kPass : GateOutcome::kInconclusive;
}

std::string EndOf(const GateRule& rule, const Evidence& evidence, GateOutcome outcome) {
  if (outcome == GateOutcome::kPass) return evidence.good;
  if (outcome == GateOutcome::kFail) return evidence.bad;
  const std::string why =
      evidence.blocked.empty() ? fmt::format("shown neither {} nor {}", evidence.bad, evidence.good) : evidence.blocked;
  return why + (rule.on_inconclusive == OnInconclusive::kFail ? "; inconclusive counts as failed here" : "");
}

/// @param family  how many p-values were corrected together; 0: none was.
RuleDecision Finish(const GateRule& rule, Evidence& evidence, std::ptrdiff_t family) {
  RuleDecision& decision = evidence.decision;
  const GateOutcome outcome = OutcomeOf(rule, evidence);
  if (family > 1 && decision.p_adjusted && *decision.p_adjusted < 1)
    decision.statement += fmt::format("; over {} rules {}", family, PValue(*decision.p_adjusted));
  decision.statement += ": " + EndOf(rule, evidence, outcome) + ".";
  decision.more = outcome == GateOutcome::kInconclusive ? evidence.more : "";
  const bool fails = outcome == GateOutcome::kInconclusive && rule.on_inconclusive == OnInconclusive::kFail;
  decision.outcome = fails ? GateOutcome::kFail : outcome;
  return std::move(decision);
}

GateOutcome WorstOf(const std::vector<RuleDecision>& rules) {
  for (const GateOutcome outcome : {GateOutcome::kFail, GateOutcome::kInconclusive}) {
    if (std::ranges::find(rules, outcome, &RuleDecision::outcome) != rules.end()) return outcome;
  }
  return GateOutcome::kPass;
}

/// Over everything of the baseline that the rule could mean.
double BaselineRate(const GateRule& rule, const PinnedResult* baseline) {
  double successes = 0, trials = 0;
  if (!baseline) return kSupposedRate;
  const std::vector<std::string> known = baseline->Policies();
  std::string policy = rule.baseline_policy.empty() ? rule.policy : rule.baseline_policy;
  if (std::ranges::find(known, policy) == known.end()) policy.clear();  // its only one is meant
  for (const PinnedCell& cell : baseline->cells) {
    if ((!rule.task.empty() && cell.task != rule.task) || (!rule.world.empty() && cell.world != rule.world)) continue;
    if (!policy.empty() && cell.policy != policy) continue;
    for (const PinnedOutcome& one : cell.outcomes) {
      trials += one.Counts();
      successes += one.outcome == Outcome::kSuccess;
    }
  }
  return trials > 0 ? successes / trials : kSupposedRate;
}

/// "124 pairs", "1 episode"
std::string Text(const SampleSize& size, const std::string& one) {
  return size.exact ? Counted(size.n, one) : size.exact.reason() + " " + one + "s";
}

/// "124 pairs if 20 % of the states flip (260 episodes of each unpaired at 70 %)".
std::string SizeOf(const GateRule& rule, double rate) {
  const Promise promise{rule.alpha, kPower};
  const std::string flips = fmt::format("if {} of the states flip", Percent(kSupposedFlips));
  if (rule.test == GateTest::kSavi) {
    const FlipRates rates{kSupposedFlips / 2, kSupposedFlips / 2};
    const SampleSize size = PairsForSequentialNonInferiority(rates, rule.margin, promise);
    return fmt::format("{} {} (less where an earlier look shows it)", Text(size, "pair"), flips);
  }
  const std::string pairs = Text(PairsForNonInferiority(kSupposedFlips, rule.margin, promise), "pair") + " " + flips,
                    trials = Text(TrialsForNonInferiority(rate, rule.margin, promise), "episode") + " of each";
  return rule.is_paired ? fmt::format("{} ({} unpaired at {})", pairs, trials, Percent(rate))
                        : fmt::format("{} at {} ({})", trials, Percent(rate), pairs);
}

}  // namespace

void DemandBaseline(const GateRules& rules, const PinnedResult& baseline) {
  for (const GateRule& rule : rules.rules) {
    if (rule.Compares()) DemandSideOf(rule, rules.judge, baseline);
  }
}

std::vector<std::string> SizesOf(const GateRules& rules, const PinnedResult* baseline) {
  std::vector<std::string> sizes;
  for (const GateRule& rule : rules.rules) {
    if (!rule.Compares()) continue;
    sizes.push_back(fmt::format(
        "{}: to show with {} power that an equal candidate is not worse by {:g} points (alpha {:g}, {}) takes {}",
        rule.name, Percent(kPower), 100 * rule.margin, rule.alpha,
        rule.test == GateTest::kSavi ? "whenever one looks" : "one-sided", SizeOf(rule, BaselineRate(rule, baseline))));
  }
  return sizes;
}

GateResult Decide(const GateRules& rules, const GateCandidate& candidate, const PinnedResult* baseline) {
  const PinnedResult data = Pin(candidate.run, candidate.folder);
  GateResult result;
  GateDecision& decision = result.decision;
  decision.name = rules.name;
  decision.judge = data.judge;
  decision.rules_hash = rules.hash;
  decision.baseline_hash = baseline ? baseline->sha256 : "";
  decision.data_hash = data.store_hash;
  decision.sizes = SizesOf(rules, baseline);
  const RunData& there = candidate.run.data;
  const GateInput input{
      candidate.run, {data, baseline, MissingOf(there.plan, there.episodes)}, rules.name, candidate.looks};
  std::vector<Evidence> evidences;
  for (const GateRule& rule : rules.rules) evidences.push_back(Examine(rule, input));
  Correct(rules.correction, evidences);
  const auto family =
      rules.correction == GateCorrection::kNone
          ? 0
          : std::ranges::count_if(evidences, [](const Evidence& one) { return bool(one.decision.p_adjusted); });
  for (std::size_t i = 0; i < evidences.size(); ++i) {
    if (evidences[i].look) result.looks.push_back(*evidences[i].look);
    decision.rules.push_back(Finish(rules.rules[i], evidences[i], family));
  }
  decision.outcome = WorstOf(decision.rules);
  return result;
}

}  // namespace evac
