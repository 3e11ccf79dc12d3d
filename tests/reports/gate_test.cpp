#include "reports/gate.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/statistics/inverted_interval.h"
#include "core/statistics/planning.h"
#include "core/statistics/sequential.h"
#include "core/statistics/sequential_planning.h"
#include "core/statistics/two_samples.h"
#include "reports/gate_evidence.h"
#include "reports/gate_output.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

GateRules Rules(const std::string& gates, const std::string& top = "") {
  return ReadGateRules(Config::FromText(top + "gates:\n" + gates, "gate.yaml"));
}

/// One policy on one task, as many states as letters, in sim alone.
SampleRun RunOf(const Outcomes& sim) { return SampleRun({{"take_bottle", "pick", "good", "-", sim}}); }

PinnedResult PinOf(const SampleRun& run) { return Pin(run.Summary({.bootstrap_replicates = 1}), "out/main"); }

GateDecision Decided(const GateRules& rules, const Outcomes& candidate, const Outcomes& baseline,
                     const std::vector<SequentialLook>& looks = {}) {
  const SampleRun now = RunOf(candidate), then = RunOf(baseline);
  const PinnedResult pinned = PinOf(then);
  return Decide(rules, {now.Summary({.bootstrap_replicates = 1}), "out/candidate", looks}, &pinned).decision;
}

Outcomes Repeat(int count, char outcome) { return Outcomes(static_cast<std::size_t>(count), outcome); }

const std::string kMcnemar = "  - {name: r, test: paired_mcnemar, world: sim, margin: 0.1}\n";

std::string MessageOf(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "nothing was thrown";
}

TEST(Gate, APlantedRegressionFailsWithItsNumbersAndBothClips) {
  const GateDecision decision = Decided(Rules(kMcnemar), Repeat(28, 's') + Repeat(12, 'f'), Repeat(40, 's'));
  EXPECT_EQ(decision.outcome, GateOutcome::kFail);
  const RuleDecision& rule = decision.rules.at(0);
  EXPECT_THAT(rule.statement,
              AllOf(HasSubstr("pick@good 70 % [55, 82] against pick@good 100 % [91, 100]"),
                    HasSubstr("40 pairs, 0 better / 12 worse, p < 0.001 (exact McNemar)"), HasSubstr(": worse.")));
  ASSERT_EQ(rule.counter_examples.size(), 12u);
  EXPECT_EQ(rule.counter_examples[0].initial_state, "41-0028");
  EXPECT_EQ(rule.counter_examples[0].candidate_video, "out/candidate/videos/sim/take_bottle/pick@good/41-0028-s1.mp4");
  EXPECT_EQ(rule.counter_examples[0].baseline_video, "out/main/videos/sim/take_bottle/pick@good/41-0028-s1.mp4");
  EXPECT_THAT(GateText(decision), AllOf(HasSubstr("FAIL"), HasSubstr("41-0028"), HasSubstr("and 2 more")));
}

TEST(Gate, TheSameOutcomesPassWhenTheyAreManyAndAreInconclusiveWhenFew) {
  const GateDecision many = Decided(Rules(kMcnemar), Repeat(40, 's'), Repeat(40, 's'));
  EXPECT_EQ(many.outcome, GateOutcome::kPass);
  EXPECT_THAT(many.rules[0].statement, HasSubstr("not worse by 10 points"));
  EXPECT_EQ(many.rules[0].more, "");
  EXPECT_EQ(Decided(Rules(kMcnemar), Repeat(25, 's'), Repeat(25, 's')).outcome, GateOutcome::kPass);
  EXPECT_EQ(Decided(Rules(kMcnemar), Repeat(24, 's'), Repeat(24, 's')).outcome, GateOutcome::kInconclusive);
  const GateDecision few = Decided(Rules(kMcnemar), "ssssssf", "sssssfs");
  EXPECT_EQ(few.outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(few.rules[0].more, HasSubstr("more pairs to show it not worse by 10 points"));
}

TEST(Gate, TooFewStatesOrTooManyErrorsAreInconclusiveWhateverTheNumbersSay) {
  const std::string rule = "  - {name: r, test: paired_mcnemar, world: sim, min_states: 50, max_error_share: 0.02}\n";
  EXPECT_THAT(Decided(Rules(rule), Repeat(40, 'f'), Repeat(40, 's')).rules[0].statement,
              HasSubstr("40 of at least 50 states"));
  const GateDecision errors = Decided(Rules(rule), "ee" + Repeat(58, 'f'), Repeat(60, 's'));
  EXPECT_EQ(errors.outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(errors.rules[0].statement, HasSubstr("2 of 60 episodes (3 %) could not go on, more than 2 %"));
}

TEST(Gate, InconclusiveCountsAsFailedWhereTheRulesSaySo) {
  const GateDecision decision = Decided(Rules(kMcnemar, "on_inconclusive: fail\n"), "sssf", "sssf");
  EXPECT_EQ(decision.outcome, GateOutcome::kFail);
  EXPECT_THAT(decision.rules[0].statement, HasSubstr("inconclusive counts as failed here"));
}

TEST(Gate, HolmHoldsTheFalseAlarmsOfTheWholeFile) {
  // 6 flips to none: exact McNemar p = 2 / 64 = .03125 each.
  const std::string two =
      "  - {name: a, test: paired_mcnemar, world: sim}\n  - {name: b, test: paired_mcnemar, world: sim}\n";
  const Outcomes now = "ffffffss", then = "ssssssss";
  EXPECT_EQ(Decided(Rules(kMcnemar), now, then).outcome, GateOutcome::kFail);
  const GateDecision corrected = Decided(Rules(two), now, then);
  EXPECT_EQ(corrected.outcome, GateOutcome::kInconclusive);
  EXPECT_DOUBLE_EQ(*corrected.rules[0].p, 0.03125);
  EXPECT_DOUBLE_EQ(*corrected.rules[0].p_adjusted, 0.0625);
  EXPECT_THAT(corrected.rules[0].statement, HasSubstr("; over 2 rules p = 0.06"));
  const GateDecision each = Decided(Rules(two, "correction: none\n"), now, then);
  EXPECT_EQ(each.outcome, GateOutcome::kFail);
  EXPECT_THAT(each.rules[0].statement, Not(HasSubstr("over 2 rules"))) << "nothing was corrected";
}

TEST(Gate, NonInferiorityLooksAtTheMarginAlone) {
  const std::string rule = "  - {name: r, test: noninferiority, world: sim, margin: 0.3}\n";
  // 8 of 60 worse: significant (p = .008), but the interval ends well above -30 points.
  const Outcomes now = Repeat(8, 'f') + Repeat(52, 's'), then = Repeat(60, 's');
  EXPECT_EQ(Decided(Rules(rule), now, then).outcome, GateOutcome::kPass);
  EXPECT_EQ(Decided(Rules(kMcnemar), now, then).outcome, GateOutcome::kFail);
  EXPECT_EQ(Decided(Rules(rule), Repeat(40, 'f') + Repeat(20, 's'), then).outcome, GateOutcome::kFail);
}

TEST(Gate, AnotherListOfStatesIsRefusedUnlessTheRuleIsUnpaired) {
  EXPECT_THAT(MessageOf([] { Decided(Rules(kMcnemar), "sss", "ssss"); }),
              AllOf(HasSubstr("gate rule 'r': initial states: found another list"), HasSubstr("none only here"),
                    HasSubstr("1 (such as take_bottle 41-0003 seed 1) only there")));
  for (const char* unpaired : {"  - {name: r, test: boschloo, world: sim}\n",
                               "  - {name: r, test: noninferiority, paired: false, world: sim}\n"}) {
    EXPECT_EQ(Decided(Rules(unpaired), Repeat(10, 'f'), Repeat(12, 's')).outcome, GateOutcome::kFail) << unpaired;
    EXPECT_EQ(Decided(Rules(unpaired), Repeat(100, 's'), Repeat(90, 's')).outcome, GateOutcome::kPass) << unpaired;
  }
}

TEST(Gate, WhatIsNotThereIsNamedWithWhatIs) {
  const auto message = [](const std::string& rule) {
    return MessageOf([&] { Decided(Rules("  - {name: r, test: paired_mcnemar" + rule + "}\n"), "s", "s"); });
  };
  EXPECT_THAT(message(""), HasSubstr("world: found nothing, wanted one of: real, sim"));
  EXPECT_THAT(message(", world: moon"), HasSubstr("world: found 'moon', wanted one of: real, sim"));
  EXPECT_THAT(message(", world: sim, policy: x"), HasSubstr("policy: found 'x', wanted one of: pick@good"));
  EXPECT_THAT(message(", world: sim, task: x"), HasSubstr("found no episode of pick@good on task 'x' in sim"));
  const SampleRun run = RunOf("s");
  EXPECT_THAT(MessageOf([&] {
                Decide(Rules(kMcnemar), {run.Summary(), "out", {}}, nullptr);
              }),
              HasSubstr("baseline: found none, wanted --baseline"));
}

TEST(Gate, SequentialBetsRememberTheirBestLookAndMayHaveSeenAPart) {
  const GateRules rules = Rules("  - {name: r, test: savi, world: sim, margin: 0.1}\n");
  const Outcomes then = Repeat(40, 's');
  const SampleRun early = RunOf(Repeat(9, 'f')), base = RunOf(then);
  const PinnedResult pinned = PinOf(base);
  const GateResult first = Decide(rules, {early.Summary({.bootstrap_replicates = 1}), "out", {}}, &pinned);
  EXPECT_EQ(first.decision.outcome, GateOutcome::kFail) << "9 flips to none: E = 52";
  ASSERT_EQ(first.looks.size(), 1u);
  EXPECT_EQ(first.looks[0].only_second, 9);
  // Later looks may be luckier; the best one stays.
  const SampleRun later = RunOf(Repeat(9, 'f') + Repeat(31, 's'));
  const GateResult second = Decide(rules, {later.Summary({.bootstrap_replicates = 1}), "out", first.looks}, &pinned);
  EXPECT_DOUBLE_EQ(*second.decision.rules[0].p, 1 / first.looks[0].e_value);
  EXPECT_EQ(Decide(rules, {early.Summary({.bootstrap_replicates = 1}), "out", first.looks}, &pinned).looks.size(), 0u)
      << "the same data are no new look";
}

/// A run of policy p on task t in sim against such a baseline.
GateResult DecidedOnRepeats(const std::string& rule, const std::vector<std::string>& now,
                            const std::vector<std::string>& then) {
  const PinnedResult pinned = Pin(RepeatedRun({{"t", "p", {}, then}}), "out/main");
  return Decide(Rules("  - {name: r, world: sim, " + rule + "}\n"),
                {RepeatedRun({{"t", "p", {}, now}}), "out/candidate", {}}, &pinned);
}

TEST(Gate, SequentialBetsTakeOnePairOfEachStateWhateverTheSeeds) {
  const GateResult result = DecidedOnRepeats("test: savi", Alike(10, "fffs"), Alike(10, "ssss"));
  EXPECT_EQ(result.decision.outcome, GateOutcome::kInconclusive) << "three states of four flipped, not thirty";
  const RuleDecision& rule = result.decision.rules.at(0);
  EXPECT_THAT(rule.statement, HasSubstr("4 pairs, one of each state, 0 better / 3 worse; e-value 2.5"));
  EXPECT_EQ(rule.states, 4);
  EXPECT_EQ(rule.flips_worse, 3);
  EXPECT_EQ(rule.value.n, 40) << "rates are of all episodes";
  const Estimate sequence = ConfidenceSequence({3, 4}, 1 - 0.05 / 2), none = ConfidenceSequence({0, 4}, 1 - 0.05 / 2);
  EXPECT_DOUBLE_EQ(rule.difference.interval->low, none.interval->low - sequence.interval->high);
  ASSERT_EQ(result.looks.size(), 1u);
  EXPECT_EQ(result.looks[0].pairs, 4);
  EXPECT_EQ(result.looks[0].only_second, 3);
}

TEST(Gate, WhichPairOfAStateIsBetOnDoesNotDependOnHowFarTheRunIs) {
  std::vector<std::string> part = Alike(3, "ffss");
  part[0] = "-fss";  // of state 0 the first seed is not there yet: nothing stands in for it
  EXPECT_EQ(DecidedOnRepeats("test: savi", part, Alike(3, "ssss")).looks.at(0).pairs, 3);
  std::vector<std::string> then = Alike(3, "ssss");
  then[0] = "-sss";  // the baseline never had it: its second seed is the first
  EXPECT_EQ(DecidedOnRepeats("test: savi", part, then).looks.at(0).pairs, 4);
}

TEST(Gate, HowManyMoreIsPlannedFromWhatRepeatsTell) {
  const RuleDecision paired =
      DecidedOnRepeats("test: paired_mcnemar", Alike(10, "fffs"), Alike(10, "ssss")).decision.rules.at(0);
  EXPECT_THAT(paired.statement,
              HasSubstr("40 pairs, 0 better / 30 worse, p = 0.50 (exact McNemar on 3 effective pairs)"));
  const SampleSize size = PairsForMcNemar({0.5 / 4, 2.75 / 4});
  EXPECT_THAT(paired.more, HasSubstr(fmt::format("about {} more pairs to show it worse",
                                                 *FurtherWanted(static_cast<double>(size.n), {40, 3}))));
  const RuleDecision unpaired =
      DecidedOnRepeats("test: boschloo", Alike(10, "sssf"), Alike(10, "sssf")).decision.rules.at(0);
  EXPECT_THAT(unpaired.statement, HasSubstr("(Boschloo on 4 and 4 effective episodes)"));
  EXPECT_THAT(unpaired.more, HasSubstr("about 2560 more episodes of each")) << "260 tell as much as 2600 such";
}

TEST(Gate, OneFailureMoreIsNoReasonToPass) {
  const std::vector<std::string> perfect(4, Repeat(20, 's'));
  std::vector<std::string> one_worse = perfect;
  one_worse[0][7] = 'f';
  for (const char* rule : {"test: paired_mcnemar, margin: 0.1", "test: noninferiority, margin: 0.1"}) {
    EXPECT_EQ(DecidedOnRepeats(rule, perfect, perfect).decision.outcome, GateOutcome::kInconclusive) << rule;
    EXPECT_EQ(DecidedOnRepeats(rule, one_worse, perfect).decision.outcome, GateOutcome::kInconclusive) << rule;
  }
  const std::vector<std::string> ten(4, Repeat(10, 's'));
  std::vector<std::string> ten_but_one = ten;
  ten_but_one[0][7] = 'f';
  for (const char* rule : {"test: boschloo, margin: 0.15", "test: noninferiority, paired: false, margin: 0.15"}) {
    EXPECT_EQ(DecidedOnRepeats(rule, ten, ten).decision.outcome, GateOutcome::kInconclusive) << rule;
    EXPECT_EQ(DecidedOnRepeats(rule, ten_but_one, ten).decision.outcome, GateOutcome::kInconclusive) << rule;
  }
  for (const std::size_t states : {3, 10}) {
    std::vector<std::string> now(4, Outcomes(states, 's'));
    double lowest = 1;
    for (std::size_t failures = 0; failures <= 4 * states; ++failures) {
      const RuleDecision rule = DecidedOnRepeats("test: ci_lower, at_least: 0.85", now, {"s"}).decision.rules.at(0);
      EXPECT_NE(rule.outcome, GateOutcome::kPass) << "all successes in so few states do not show it either";
      EXPECT_LE(rule.value.interval->low, lowest + 1e-9) << failures << " of " << 4 * states;
      lowest = rule.value.interval->low;
      if (failures < 4 * states) now[failures / states][failures % states] = 'f';
    }
  }
}

TEST(Gate, ManyUnpairedEpisodesAreTestedAsEverywhere) {
  const Outcomes now = Repeat(330, 's') + Repeat(270, 'f'), then = Repeat(372, 's') + Repeat(228, 'f');
  const RuleDecision rule = DecidedOnRepeats("test: boschloo", {now}, {then}).decision.rules.at(0);
  EXPECT_THAT(rule.statement, HasSubstr("(Newcombe)"));
  const auto states = [](const Outcomes& outcomes) {
    std::vector<Count> counts;
    for (const char outcome : outcomes) counts.push_back({outcome == 's', 1});
    return counts;
  };
  EXPECT_DOUBLE_EQ(*rule.p, BoschlooOrNewcombe(states(now), states(then)).two_sided);
}

TEST(Gate, UnpairedRulesWantOneTaskAndTheSameOnBothSides) {
  const RepeatedCell take{"take", "p", {}, {"ssss"}}, place{"place", "p", {}, {"ssss"}};
  const auto message = [](const RunSummary& now, const PinnedResult& then) {
    return MessageOf([&] { Decide(Rules("  - {name: r, test: boschloo, world: sim}\n"), {now, "out", {}}, &then); });
  };
  const RunSummary one = RepeatedRun({take}), other = RepeatedRun({place}), both = RepeatedRun({take, place});
  EXPECT_THAT(message(one, Pin(both, "out")),
              HasSubstr("gate rule 'r': task: found 2 tasks in the baseline, wanted one: unpaired tasks pooled can say "
                        "the opposite of each"));
  EXPECT_THAT(message(both, Pin(one, "out")), HasSubstr("task: found 2 tasks, wanted one: unpaired tasks pooled"));
  EXPECT_THAT(message(one, Pin(other, "out")), HasSubstr("task: found take, wanted the baseline's, place"));
  PinnedResult changed = Pin(one, "out");
  changed.tasks["take"] = "0ther";
  EXPECT_THAT(message(one, changed), HasSubstr("page of task take: found"));
  EXPECT_EQ(message(one, Pin(one, "out")), "nothing was thrown");
  const PinnedResult pinned = Pin(both, "out");
  const GateRules named = Rules("  - {name: r, test: boschloo, world: sim, task: take}\n");
  EXPECT_EQ(Decide(named, {both, "out", {}}, &pinned).decision.rules.at(0).states, 4) << "the rule names its task";
}

TEST(Gate, ARateOfItsOwnIsHeldAgainstAFloorByClopperPearson) {
  const auto outcome = [](const Outcomes& outcomes) {
    return Decided(Rules("  - {name: r, test: ci_lower, world: sim, at_least: 0.7}\n"), outcomes, "s").outcome;
  };
  EXPECT_EQ(outcome(Repeat(40, 's')), GateOutcome::kPass);
  EXPECT_EQ(outcome(Repeat(30, 's') + Repeat(10, 'f')), GateOutcome::kInconclusive);
  EXPECT_EQ(outcome(Repeat(20, 's') + Repeat(20, 'f')), GateOutcome::kFail);
}

TEST(Gate, ErrorsAreCountedAndNotTested) {
  const std::string rule = "  - {name: r, test: error_share, world: sim, at_most: 0.1}\n";
  EXPECT_EQ(Decided(Rules(rule),
                    "sssssssss"
                    "e",
                    "s")
                .outcome,
            GateOutcome::kPass);
  EXPECT_EQ(Decided(Rules(rule),
                    "ssssssss"
                    "ee",
                    "s")
                .outcome,
            GateOutcome::kFail);
}

TEST(Gate, ErrorsOfAllPoliciesLeaveNoHoleForAName) {
  const std::string rule = "  - {name: r, test: error_share, world: sim, at_most: 0.1}\n";
  EXPECT_THAT(Decided(Rules(rule), "sss", "s").rules.at(0).statement, HasSubstr("0 of 3 episodes (0 %) could not go"));
}

TEST(Gate, ACorrelationIsHeldAgainstItsFloorAndMmrvAgainstItsCeiling) {
  const auto outcome = [](const std::string& rule) {
    const SampleRun& run = LargeRun();
    return Decide(Rules("  - {name: r, test: correlation, world: sim, " + rule + "}\n"), {run.Summary(), "out", {}},
                  nullptr)
        .decision;
  };
  const GateDecision good = outcome("at_least: 0.5");
  EXPECT_EQ(good.outcome, GateOutcome::kPass) << good.rules[0].statement;
  EXPECT_EQ(outcome("at_least: 0.999").outcome, GateOutcome::kFail);
  EXPECT_EQ(outcome("metric: mmrv, at_most: 0.5").outcome, GateOutcome::kPass);
  EXPECT_THAT(MessageOf([&] { outcome("metric: mmrv, at_least: 0.5"); }),
              HasSubstr("at_least: found '0.5', wanted none"));
}

/// Policies 0, 1, … of one task, in sim as in real unless said otherwise.
RuleDecision Correlated(const std::string& rule, const std::vector<Outcomes>& real, std::vector<Outcomes> sim = {}) {
  if (sim.empty()) sim = real;
  std::vector<RepeatedCell> cells;
  for (std::size_t i = 0; i < real.size(); ++i) cells.push_back({"take", "p" + std::to_string(i), {real[i]}, {sim[i]}});
  const RunSummary run = Summarise(RepeatedRun(cells).data, {});  // resampled as often as usual
  const GateRules rules = Rules("  - {name: r, test: correlation, world: sim, " + rule + "}\n");
  return Decide(rules, {run, "out", {}}, nullptr).decision.rules.at(0);
}

TEST(Gate, RanksThatNothingPutAtRiskAreNotShownToBeRight) {
  const std::string rule = "metric: mmrv, at_most: 0.1";
  const RuleDecision two = Correlated(rule, {"ss", "ss"});
  EXPECT_EQ(two.outcome, GateOutcome::kInconclusive) << two.statement;
  EXPECT_THAT(two.statement, HasSubstr("mmrv of sim against real: 0.00 [0.00, 0.78] (90 %)"));
  EXPECT_EQ(Correlated(rule, {Repeat(40, 's'), Repeat(40, 's')}).outcome, GateOutcome::kPass)
      << "no rate is further than 7 points from another";
  const std::vector<Outcomes> apart = {Repeat(40, 's'), Repeat(20, 's') + Repeat(20, 'f'), Repeat(40, 'f')};
  EXPECT_EQ(Correlated(rule, apart).outcome, GateOutcome::kPass) << "no replicate differs, and no rank is near";
  EXPECT_EQ(Correlated("metric: spearman, at_least: 0.9", apart).outcome, GateOutcome::kPass);
}

TEST(Gate, ACorrelationThatOneFailureDecidesIsNotDecided) {
  const Outcomes all = Repeat(20, 's');
  const RuleDecision decision = Correlated("at_least: 0.7", {all, all, Repeat(19, 's') + "f"});
  EXPECT_EQ(decision.outcome, GateOutcome::kInconclusive) << decision.statement;
  EXPECT_THAT(decision.statement, HasSubstr("of 2000 replicates have none: where they would lie nobody knows"));
}

TEST(Gate, ReplicatesThatWereDroppedAreCountedInTheSentence) {
  const Outcomes all = Repeat(20, 's');
  const RuleDecision decision =  // no failure is drawn in one replicate of 26, and then all rates are equal
      Correlated("at_least: 0.7", {all, Repeat(18, 's') + "ff", "sssssf" + Repeat(14, 's')});
  EXPECT_THAT(decision.statement, HasSubstr(" of 2000 replicates had none and were dropped"));
}

TEST(Gate, ABootstrapShowsNoSmallerPThanItHasReplicates) {
  const Outcomes all = Repeat(40, 's'), none = Repeat(40, 'f');
  const RuleDecision turned = Correlated("at_least: 0.7", {all, Repeat(20, 's') + Repeat(20, 'f'), none},
                                         {none, Repeat(20, 'f') + Repeat(20, 's'), all});
  EXPECT_EQ(turned.outcome, GateOutcome::kFail);
  EXPECT_DOUBLE_EQ(*turned.p, 1.0 / 2001) << "it was 1e-9";
}

TEST(Gate, ACorrelationIsOfTheTaskThatIsNamed) {
  const auto cell = [](const std::string& task, int policy, int real, int sim) {
    const auto outcomes = [](int successes) { return Repeat(successes, 's') + Repeat(20 - successes, 'f'); };
    return RepeatedCell{task, "p" + std::to_string(policy), {outcomes(real)}, {outcomes(sim)}};
  };
  std::vector<RepeatedCell> cells;
  for (int policy = 1; policy <= 4; ++policy) {
    cells.push_back(cell("easy", policy, 4 * policy, 4 * policy));
    cells.push_back(cell("hard", policy, 4 * policy, 20 - 4 * policy));
  }
  const RunSummary run = RepeatedRun(cells);
  const auto decide = [&](const std::string& rule) {
    return Decide(Rules("  - {name: r, test: correlation, world: sim, at_least: 0.5" + rule + "}\n"), {run, "out", {}},
                  nullptr)
        .decision.rules[0];
  };
  const RuleDecision easy = decide(", task: easy"), hard = decide(", task: hard"), all = decide("");
  EXPECT_NEAR(*easy.value.value, 1, 1e-9);
  EXPECT_NEAR(*hard.value.value, -1, 1e-9);
  EXPECT_NEAR(*all.value.value, 0, 1e-9);
  EXPECT_EQ(easy.states, 80);
  EXPECT_EQ(all.states, 160);
  EXPECT_THAT(hard.statement, HasSubstr("pearson of sim against real on hard: -1.00"));
  EXPECT_THAT(MessageOf([&] { decide(", policy: p1@c"); }), HasSubstr("policy: found 'p1@c', wanted none"));
}

TEST(Gate, KappaIsOfThePolicyThatIsNamed) {
  RunSummary run = RepeatedRun({{"t", "good", {}, {Repeat(10, 's') + Repeat(10, 'f')}},
                                {"t", "odd", {}, {Repeat(10, 's') + Repeat(10, 'f')}}});
  run.judges.push_back("human");
  for (const Episode& episode : run.data.episodes) {
    auto& verdicts = run.data.verdicts[episode.key.Id()];
    Verdict other = verdicts.at("oracle");
    if (episode.key.pair.policy == "odd") other.label = other.label == Label::kSuccess ? Label::kFailure : Label::kSuccess;
    verdicts["human"] = other;
  }
  const auto kappa_of = [&](const std::string& policy) {
    const std::string rule = "  - {name: r, test: judge_kappa, world: sim, at_least: 0.8, policy: " + policy + "}\n";
    return Decide(Rules(rule), {run, "out", {}}, nullptr).decision.rules[0];
  };
  EXPECT_EQ(*kappa_of("good@c").value.value, 1);
  EXPECT_EQ(*kappa_of("odd@c").value.value, -1);
  EXPECT_EQ(kappa_of("odd@c").policy, "odd@c");
}

TEST(Gate, TheJudgeIsHeldAgainstAnother) {
  SampleRun run = RunOf(Repeat(20, 's') + Repeat(20, 'f'));
  int turn = 0;
  for (const Episode& episode : run.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "human";
    verdict.label = turn++ < 20 ? Label::kSuccess : Label::kFailure;
    run.store().AddVerdict(verdict);
  }
  const auto decide = [&](const std::string& rule) {
    return Decide(Rules("  - {name: r, test: judge_kappa, world: sim, " + rule + "}\n"),
                  {run.Summary({.bootstrap_replicates = 1}), "out", {}}, nullptr)
        .decision;
  };
  const GateDecision decision = decide("at_least: 0.8");
  EXPECT_THAT(decision.rules[0].statement, HasSubstr("kappa of oracle with human in sim: 1.00 [0.86, 1.00]"));
  EXPECT_THAT(decision.rules[0].statement, HasSubstr("over 40 episodes of 40 initial states that both judged"));
  EXPECT_THAT(MessageOf([&] { decide("at_least: 0.8, against: vlm"); }), HasSubstr("against: found 'vlm'"));
}

TEST(Gate, TheClipsOfAStateAreOneStateToAJudge) {
  RunSummary run = RepeatedRun({{"t", "p", {}, Alike(2, Repeat(10, 's') + Repeat(10, 'f'))}});
  run.judges.push_back("human");
  for (auto& [episode, verdicts] : run.data.verdicts) verdicts["human"] = verdicts.at("oracle");
  const auto decide = [&](const std::string& rule) {
    return Decide(Rules("  - {name: r, test: judge_kappa, world: sim, at_least: 0.8" + rule + "}\n"), {run, "out", {}},
                  nullptr)
        .decision.rules[0];
  };
  EXPECT_THAT(decide("").statement, HasSubstr("over 40 episodes of 20 initial states that both judged"));
  EXPECT_EQ(decide("").states, 20);
  const RuleDecision few = decide(", min_states: 21");
  EXPECT_EQ(few.outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(few.statement, HasSubstr("20 of at least 21 states"));
}

TEST(Gate, TheStoredDecisionIsTheDecision) {
  const GateDecision decision = Decided(Rules(kMcnemar), Repeat(28, 's') + Repeat(12, 'f'), Repeat(40, 's'));
  const GateDecision again = GateDecisionFromJson(JsonOf(decision).dump());
  EXPECT_EQ(JsonOf(again), JsonOf(decision));
  EXPECT_EQ(again.Key(), decision.Key());
  EXPECT_THROW(GateDecisionFromJson("{}"), Error);
}

TEST(Gate, SizesAreKnownBeforeTheRun) {
  const std::vector<std::string> sizes = SizesOf(Rules(kMcnemar), nullptr);
  ASSERT_EQ(sizes.size(), 1u);
  EXPECT_THAT(sizes[0], AllOf(HasSubstr("124 pairs if 20 % of the states flip"), HasSubstr("260 episodes of each")))
      << sizes[0];
}

TEST(Gate, ASequentialRuleTakesMoreThanOneThatLooksOnceAndSaysSo) {
  const std::vector<std::string> sizes = SizesOf(Rules("  - {name: r, test: savi, world: sim}\n"), nullptr);
  const SampleSize size = PairsForSequentialNonInferiority({0.1, 0.1}, 0.1);
  EXPECT_THAT(sizes.at(0), HasSubstr(fmt::format("takes {} pairs if 20 % of the states flip", size.n)));
  EXPECT_GT(size.n, 300);
  const RuleDecision rule = DecidedOnRepeats("test: savi", {"sssf", "sffs"}, {"ssss", "ssss"}).decision.rules.at(0);
  EXPECT_THAT(rule.more, HasSubstr(fmt::format("about {} more pairs to show it worse",
                                               PairsForFlipsBet({0.5 / 5, 1.5 / 5}).n - rule.states)))
      << rule.more;
}

TEST(Gate, ARuleAgainstAMarginIsPlannedAgainstIt) {
  const auto more = [](const std::string& now) {
    return DecidedOnRepeats("test: noninferiority, margin: 0.1", {now}, {Repeat(static_cast<int>(now.size()), 's')})
        .decision.rules.at(0)
        .more;
  };
  EXPECT_THAT(more(Repeat(16, 's') + Repeat(4, 'f')), HasSubstr("more pairs to show it worse by more than 10 points"));
  EXPECT_THAT(more(Repeat(20, 's')), HasSubstr("more pairs to show it not worse by 10 points"));
  EXPECT_THAT(more(Repeat(20, 's')), Not(HasSubstr("to show it worse")));
}

TEST(Gate, ASizeThatNobodyCanCountIsNotZero) {
  const std::string tiny = "  - {name: r, test: paired_mcnemar, world: sim, margin: 1e-10}\n";
  const std::vector<std::string> sizes = SizesOf(Rules(tiny), nullptr);
  ASSERT_EQ(sizes.size(), 1u);
  EXPECT_THAT(sizes[0], HasSubstr("takes more than can be counted pairs")) << sizes[0];
}

TEST(Gate, WithoutAPairNoNumberOfThemIsPromised) {
  EXPECT_EQ(Decided(Rules(kMcnemar), "uuuu", "ssss").rules.at(0).more,
            "Nobody has judged the run yet: evac judge RUN --judge oracle.");
}

TEST(Gate, AnInvertedIntervalTouchesItsThreshold) {
  const PairedOutcomes outcomes{{2, 14}, 50};
  const IntervalAt interval = [&](double confidence) { return TangoDifference(outcomes, confidence).interval; };
  const double p = PBelow(interval, -0.1);
  EXPECT_NEAR(interval(1 - 2 * p)->high, -0.1, 1e-6);
  EXPECT_EQ(PBelow(interval, -0.5), 1) << "the value itself is above";
}

}  // namespace
}  // namespace evac
