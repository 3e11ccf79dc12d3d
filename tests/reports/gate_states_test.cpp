#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"
#include "reports/gate.h"
#include "reports/gate_data.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

/// How many initial states a rule rests on, where each was tried with several seeds or by several policies.
namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

/// Twenty states with three seeds each, of two policies in both worlds.
RuleDecision DecidedOnTwentyStates(const std::string& rule) {
  const std::vector<std::string> good = Alike(3, std::string(20, 's'));
  const std::vector<std::string> poor = Alike(3, std::string(10, 's') + std::string(10, 'f'));
  const RunSummary run = RepeatedRun({{"t", "good", good, good}, {"t", "poor", poor, poor}});
  const PinnedResult pinned = Pin(run, "out/main");
  const GateRules rules =
      ReadGateRules(Config::FromText("gates: [{name: r, world: sim, " + rule + "}]\n", "gate.yaml"));
  return Decide(rules, {run, "out", {}}, &pinned).decision.rules.at(0);
}

/// Three seeds of twenty states passed for sixty states: a gate passed on a third of those that its owner asked for.
TEST(GateStates, EachCountsOnceWhateverTheSeedsAndThePolicies) {
  for (const std::string rule : {"test: paired_mcnemar, policy: good@c", "test: noninferiority, policy: good@c",
                                 "test: boschloo, policy: good@c", "test: savi, policy: good@c",
                                 "test: ci_lower, policy: good@c, at_least: 0.5",
                                 "test: correlation, metric: pearson, at_least: 0.5",
                                 "test: error_share, at_most: 0.02", "test: error_share, policy: good@c, at_most: 0"}) {
    SCOPED_TRACE(rule);
    const RuleDecision few = DecidedOnTwentyStates(rule + ", min_states: 21");
    EXPECT_EQ(few.outcome, GateOutcome::kInconclusive);
    EXPECT_THAT(few.statement, HasSubstr("20 of at least 21 states"));
    EXPECT_EQ(few.more, "The rule asks for 1 more initial state.");
    EXPECT_THAT(DecidedOnTwentyStates(rule + ", min_states: 20").statement, Not(HasSubstr("of at least")));
  }
  EXPECT_EQ(DecidedOnTwentyStates("test: paired_mcnemar, policy: good@c").states, 60) << "in JSON with seeds";
}

/// The rule asked for a hundred states, and passed on one.
TEST(GateStates, ARuleOfErrorsThatAsksForMoreThanWereTriedIsInconclusiveWhicheverWayItLeans) {
  const RunSummary run = RepeatedRun({{"t", "good", {"ss"}, {"ss"}}});
  const auto decided = [&run](const std::string& fields) {
    const std::string rule = "gates: [{name: r, test: error_share, world: sim, at_most: 0, " + fields + "}]\n";
    return Decide(ReadGateRules(Config::FromText(rule, "gate.yaml")), {run, "out", {}}, nullptr).decision;
  };
  EXPECT_EQ(decided("min_states: 2").outcome, GateOutcome::kPass);
  EXPECT_EQ(decided("min_states: 100").outcome, GateOutcome::kInconclusive);
  EXPECT_EQ(decided("min_states: 100").rules.at(0).more, "The rule asks for 98 more initial states.");
  EXPECT_EQ(decided("min_states: 100, on_inconclusive: fail").outcome, GateOutcome::kFail);
}

/// The points were counted, a fifth of the states where there are eight over forty; what is drawn again are states.
TEST(GateStates, HowManyMoreACorrelationTakesIsSaidOfThem) {
  std::vector<RepeatedCell> cells;
  for (const std::size_t successes : {4, 8, 12, 16}) {  // in sim in other states, so that draws differ
    const std::string yes(successes, 's'), no(20 - successes, 'f');
    cells.push_back({"t", "p" + std::to_string(successes), {yes + no}, {no + yes}});
  }
  const RunSummary run = Summarise(RepeatedRun(cells).data, {});  // resampled as often as usual
  const auto held_at = [&run](double at_least) {
    const std::string rule = fmt::format("{{name: r, test: correlation, world: sim, at_least: {}}}", at_least);
    const GateRules rules = ReadGateRules(Config::FromText("gates: [" + rule + "]\n", "gate.yaml"));
    return Decide(rules, {run, "out", {}}, nullptr).decision.rules.at(0);
  };
  const Interval seen = *held_at(0.5).value.interval;
  const double threshold = (seen.low + seen.high) / 2;  // within the interval: neither shown
  const RuleDecision rule = held_at(threshold);
  ASSERT_EQ(rule.outcome, GateOutcome::kInconclusive) << rule.statement;
  const double value = *rule.value.value;
  ASSERT_GT(value, threshold);
  const double ratio = (value - seen.low) / (value - threshold) * (1 + NormalQuantile(0.8) / NormalQuantile(1 - 0.05));
  EXPECT_EQ(rule.more, fmt::format("If the value stays as seen: about {} more initial states.",
                                   std::ceil(20 * (ratio * ratio - 1))));
}

/// It took "0 episodes of each at 100 %".
TEST(GateStates, ABaselineThatNeverFailsIsPlannedForToo) {
  const PinnedResult pinned = Pin(RepeatedRun({{"t", "p", {}, {std::string(40, 's')}}}), "out/main");
  const auto size_of = [&pinned](const std::string& test) {
    const GateRules rules =
        ReadGateRules(Config::FromText("gates: [{name: r, world: sim, test: " + test + "}]\n", "gate.yaml"));
    return SizesOf(rules, &pinned).at(0);
  };
  EXPECT_THAT(size_of("boschloo"), HasSubstr("takes 25 episodes of each at 100 %"));
  EXPECT_THAT(size_of("noninferiority"), HasSubstr("(25 episodes of each unpaired at 100 %)"));
}


/// Fifty successes on an easy task, and what else the suite asks for.
RunSummary EasyPartOf(const std::vector<PlannedEpisodes>& others) {
  RunSummary run = RepeatedRun({{"easy", "p", {}, {std::string(50, 's')}}});
  run.data.plan = {{"easy", "sim", "p", "c", 50}};
  run.data.plan.insert(run.data.plan.end(), others.begin(), others.end());
  return run;
}

RuleDecision DecidedOf(const RunSummary& run, const std::string& rule) {
  const PinnedResult pinned = Pin(EasyPartOf({}), "out/main");
  const std::string text = "gates: [{name: r, world: sim, " + rule + "}]\n";
  return Decide(ReadGateRules(Config::FromText(text, "gate.yaml")), {run, "out", {}}, &pinned).decision.rules.at(0);
}

/// A run that was killed behind its easy task passed on that.
TEST(GateStates, ARunThatIsNotWholeIsDecidedByNoRuleButABet) {
  const RunSummary whole = EasyPartOf({}), part = EasyPartOf({{"hard", "sim", "p", "c", 30}});
  for (const std::string rule :
       {"test: ci_lower, at_least: 0.7", "test: paired_mcnemar", "test: boschloo, task: easy, policy: p@c",
        "test: noninferiority", "test: error_share, at_most: 0.1"}) {
    SCOPED_TRACE(rule);
    EXPECT_EQ(DecidedOf(whole, rule).outcome, GateOutcome::kPass);
    const bool is_of_easy = rule.find("task: easy") != std::string::npos;
    const RuleDecision decision = DecidedOf(part, rule);
    EXPECT_EQ(decision.outcome, is_of_easy ? GateOutcome::kPass : GateOutcome::kInconclusive);
    if (is_of_easy) continue;
    EXPECT_THAT(decision.statement, HasSubstr(": 50 of 80 episodes are there."));
    EXPECT_THAT(decision.more, HasSubstr("evac resume"));
  }
  EXPECT_THAT(DecidedOf(part, "test: savi").statement, Not(HasSubstr("are there")));
}

/// Its states were "another list than the baseline's", with the advice to ask an unpaired rule instead.
TEST(GateStates, ARunThatWasBrokenOffIsAPartOfTheBaselinesStatesAndNoOtherList) {
  const auto decided = [](std::size_t states, std::int64_t planned, const std::string& test) {
    RunSummary run = RepeatedRun({{"easy", "p", {}, {std::string(states, 's')}}});
    run.data.plan = {{"easy", "sim", "p", "c", planned}};
    return DecidedOf(run, "test: " + test);
  };
  const auto another_list = testing::ThrowsMessage<Error>(HasSubstr("found another list than the baseline's"));
  for (const std::string test : {"paired_mcnemar", "noninferiority"}) {
    SCOPED_TRACE(test);
    const RuleDecision part = decided(30, 50, test);
    EXPECT_EQ(part.outcome, GateOutcome::kInconclusive);
    EXPECT_THAT(part.statement, HasSubstr(": 30 of 50 episodes are there."));
    EXPECT_THAT(part.more, HasSubstr("evac resume"));
    EXPECT_EQ(decided(50, 50, test).outcome, GateOutcome::kPass);
    EXPECT_THAT([&] { decided(30, 30, test); }, another_list) << "no more are to come";
    EXPECT_THAT([&] { decided(60, 80, test); }, another_list) << "ten that the baseline never had";
  }
}

/// "Found no episode of p@c on task 'hard'", of a run that had not come to it yet.
TEST(GateStates, WhatHasNotBegunYetIsAwaitedAndNotInvalid) {
  const PinnedResult pinned = Pin(
      RepeatedRun({{"easy", "p", {}, {std::string(50, 's')}}, {"hard", "p", {}, {std::string(30, 's')}}}), "out/main");
  const auto result = [&pinned](const RunSummary& run, const std::string& rule) {
    const std::string text = "gates: [{name: r, " + rule + "}]\n";
    return Decide(ReadGateRules(Config::FromText(text, "gate.yaml")), {run, "out", {}}, &pinned);
  };
  const RunSummary run =
      EasyPartOf({{"hard", "sim", "p", "c", 30}, {"easy", "real", "p", "c", 20}, {"easy", "sim", "q", "c", 40}});
  const std::pair<std::string, std::string> cases[] = {
      {"world: sim, task: hard, policy: p@c", "p@c on hard in sim: 0 of 30 episodes are there."},
      {"world: real, task: easy, policy: p@c", "p@c on easy in real: 0 of 20 episodes are there."},
      {"world: sim, task: easy, policy: q@c", "q@c on easy in sim: 0 of 40 episodes are there."}};
  for (const auto& [about, statement] : cases) {
    for (const std::string test : {"paired_mcnemar", "noninferiority", "boschloo", "savi", "ci_lower, at_least: 0.5",
                                   "error_share, at_most: 0.1"}) {
      const bool compares = test.find(':') == std::string::npos;
      if (compares && about.starts_with("world: real")) continue;  // the baseline has none there either
      SCOPED_TRACE(test + ", " + about);
      const GateResult decided = result(run, "test: " + test + ", " + about);
      const RuleDecision& rule = decided.decision.rules.at(0);
      EXPECT_EQ(rule.outcome, GateOutcome::kInconclusive);
      EXPECT_EQ(rule.statement, statement);
      EXPECT_THAT(rule.more, HasSubstr("evac resume"));
      EXPECT_TRUE(decided.looks.empty()) << "nothing was bet";
      EXPECT_THAT([&] { result(EasyPartOf({}), "test: " + test + ", " + about); }, testing::Throws<Error>());
    }
  }
  EXPECT_THAT(result(run, "test: error_share, at_most: 0.1, world: real").decision.rules.at(0).statement,
              testing::StartsWith("all policies in real: 0 of 20 episodes"));
  EXPECT_THAT([&] { result(run, "test: ci_lower, at_least: 0.5, world: sim, policy: x"); },
              testing::ThrowsMessage<Error>(HasSubstr("policy: found 'x', wanted one of: p@c, q@c")));
}

TEST(GateStates, WhatIsMissingElsewhereBlocksNoRule) {
  const std::string rule = "test: ci_lower, at_least: 0.7";
  EXPECT_EQ(DecidedOf(EasyPartOf({{"easy", "real", "p", "c", 50}}), rule).outcome, GateOutcome::kPass) << "no world's";
  const RunSummary other_policy = EasyPartOf({{"easy", "sim", "q", "c", 50}});
  EXPECT_EQ(DecidedOf(other_policy, rule + ", policy: p@c").outcome, GateOutcome::kPass);
  EXPECT_EQ(DecidedOf(other_policy, rule).outcome, GateOutcome::kInconclusive) << "p is its only one only so far";
}

TEST(GateStates, ACorrelationWantsTheRealWorldWholeToo) {
  const std::vector<std::string> good = {std::string(20, 's')}, fair = {std::string(10, 's') + std::string(10, 'f')},
                                 poor = {std::string(20, 'f')};
  RunSummary run = RepeatedRun({{"t", "a", good, good}, {"t", "b", fair, fair}, {"t", "d", poor, poor}});
  const auto statement = [&] { return DecidedOf(run, "test: correlation, at_least: 0.5").statement; };
  run.data.plan = {{"t", "real", "a", "c", 20}, {"t", "sim", "a", "c", 20}};
  EXPECT_THAT(statement(), Not(HasSubstr("are there")));
  run.data.plan[0].episodes = 30;
  EXPECT_THAT(statement(), HasSubstr("40 of 50 episodes are there"));
}

/// Half of what the robot tried had broken off, and the correlation with it passed.
TEST(GateStates, ErrorsInTheRealWorldAreTheCorrelationsToo) {
  const std::string all(20, 's'), half = std::string(10, 's') + std::string(10, 'f'), none(20, 'f');
  const std::string broken_off = std::string(10, 'e') + std::string(10, 's');
  const SampleRun sample({{"t", "a", "c", broken_off, all}, {"t", "b", "c", half, half}, {"t", "d", "c", none, none}});
  const RunSummary run = sample.Summary({.bootstrap_replicates = 1});
  const std::string correlation = "test: correlation, at_least: 0.5, task: t, max_error_share: ";
  const RuleDecision decision = DecidedOf(run, correlation + "0.05");
  EXPECT_EQ(decision.outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(decision.statement, HasSubstr("10 of 120 episodes (8 %) could not go on, more than 5 %"));
  EXPECT_THAT(decision.more, HasSubstr("--retry-failed"));
  EXPECT_THAT(DecidedOf(run, correlation + "0.1").statement, Not(HasSubstr("could not go on")));
  EXPECT_THAT(DecidedOf(run, "test: ci_lower, policy: a@c, at_least: 0.5, max_error_share: 0.05").statement,
              Not(HasSubstr("could not go on"))) << "it is about sim alone";
}

TEST(GateStates, ErrorsThatAreTooManyForTheWholeFailAPartOfIt) {
  const SampleRun run({{"t", "p", "c", "-", std::string(10, 'e') + std::string(10, 's')}});
  const auto outcome = [&](std::int64_t planned) {
    RunSummary summary = run.Summary({.bootstrap_replicates = 1});
    summary.data.plan = {{"t", "sim", "p", "c", planned}};
    return DecidedOf(summary, "test: error_share, at_most: 0.1").outcome;
  };
  EXPECT_EQ(outcome(20), GateOutcome::kFail);
  EXPECT_EQ(outcome(99), GateOutcome::kFail) << "10 of 99, whatever comes";
  EXPECT_EQ(outcome(100), GateOutcome::kInconclusive);
}

TEST(GateStates, AShareOfErrorsIsHeldAgainstTheOneThatWasGiven) {
  const SampleRun run({{"t", "p", "c", "-", std::string(1, 'e') + std::string(39, 's')}});
  const RunSummary summary = run.Summary({.bootstrap_replicates = 1});
  EXPECT_THAT(DecidedOf(summary, "test: error_share, at_most: 0.024").statement, HasSubstr("more than 2.4 %"));
  EXPECT_THAT(DecidedOf(summary, "test: ci_lower, policy: p@c, at_least: 0.5, max_error_share: 0.024").statement,
              HasSubstr("could not go on, more than 2.4 %"));
}

TEST(GateStates, WhatWasDecidedOfAPartIsNotOfAWholeThatLooksTheSame) {
  const RunData whole = EasyPartOf({}).data, part = EasyPartOf({{"hard", "sim", "p", "c", 30}}).data;
  EXPECT_NE(DataHash(part), DataHash(whole));
  RunData unsaid = whole;
  unsaid.plan.clear();
  EXPECT_EQ(DataHash(unsaid), DataHash(whole)) << "an earlier evac's decision stands";
}

}  // namespace
}  // namespace evac
