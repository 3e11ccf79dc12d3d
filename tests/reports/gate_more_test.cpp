#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/gate.h"
#include "reports/gate_data.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

/// What an inconclusive rule says would decide it.
namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

RuleDecision Decided(const std::string& rule, const RunSummary& now, const RunSummary& then) {
  const PinnedResult pinned = Pin(then, "out/main");
  const GateRules rules =
      ReadGateRules(Config::FromText("gates: [{name: r, world: sim, " + rule + "}]\n", "gate.yaml"));
  return Decide(rules, {now, "out", {}}, &pinned).decision.rules.at(0);
}

std::string MoreOf(const std::string& rule, const std::string& now, const std::string& then) {
  const auto run = [](const std::string& outcomes) { return RepeatedRun({{"t", "p", {}, {outcomes}}}); };
  const RuleDecision decision = Decided(rule, run(now), run(then));
  EXPECT_EQ(decision.outcome, GateOutcome::kInconclusive) << decision.statement;
  return decision.more;
}

/// Where the candidate leaned to worse, nothing was said: the way to "not worse" alone was planned.
TEST(GateMore, AnUnpairedRuleThatLeansToWorseSaysWhatWouldShowThat) {
  const std::string boschloo = MoreOf("test: boschloo, margin: 0.1", "sssssfffff", "ssssssssff");
  EXPECT_THAT(boschloo, testing::MatchesRegex("If the rates stay as seen: about [0-9]+ more episodes of each to show "
                                              "it worse\\."));
  const std::string by_margin =
      MoreOf("test: noninferiority, paired: false, margin: 0.1", "sssssfffff", "ssssssssff");
  EXPECT_THAT(by_margin, HasSubstr("more episodes of each to show it worse by more than 10 points."));
  EXPECT_THAT(by_margin, Not(HasSubstr("not worse")));
}

TEST(GateMore, AnUnpairedRuleThatLeansToWorseWithinTheMarginSaysWhatWouldShowEither) {
  EXPECT_THAT(MoreOf("test: boschloo, margin: 0.2", "sssssssfff", "ssssssssff"),
              AllOf(HasSubstr("of each to show it not worse by 20 points, about "),
                    HasSubstr("of each to show it worse.")));
  EXPECT_THAT(MoreOf("test: boschloo, margin: 0.2", "ssssssssff", "ssssssssff"), Not(HasSubstr("show it worse")));
}

/// "0 pairs", and no word of the judge that was missing.
TEST(GateMore, OfARunThatNobodyJudgedTheCommandIsNamedThatDoes) {
  const auto run = [](const Outcomes& outcomes) {
    return SampleRun({{"t", "p", "c", "-", outcomes}}).Summary({.bootstrap_replicates = 1});
  };
  const RunSummary now = run("uuuu"), then = run("ssss");
  for (const std::string rule :
       {"test: boschloo", "test: noninferiority, paired: false", "test: ci_lower, at_least: 0.5"}) {
    const RuleDecision decision = Decided(rule, now, then);
    EXPECT_EQ(decision.outcome, GateOutcome::kInconclusive) << rule;
    EXPECT_EQ(decision.more, "Nobody has judged the run yet: evac judge RUN --judge oracle.") << rule;
  }
  EXPECT_THAT(Decided("test: error_share, at_most: 0.1", now, then).more, "") << "errors need no judge";
}

/// "1 episodes of each".
TEST(GateMore, OneIsSaidInTheSingular) {
  const GateRules rules = ReadGateRules(Config::FromText(
      "gates: [{name: r, world: sim, test: boschloo, margin: 0.9, alpha: 0.4}]\n", "gate.yaml"));
  EXPECT_THAT(SizesOf(rules, nullptr).at(0), AllOf(HasSubstr("takes 1 episode of each at "), HasSubstr("(1 pair if ")));
}

}  // namespace
}  // namespace evac
