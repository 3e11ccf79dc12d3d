#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/gate.h"
#include "tests/reports/repeated_run.h"

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
                                 "test: correlation, metric: pearson, at_least: 0.5"}) {
    SCOPED_TRACE(rule);
    const RuleDecision few = DecidedOnTwentyStates(rule + ", min_states: 21");
    EXPECT_EQ(few.outcome, GateOutcome::kInconclusive);
    EXPECT_THAT(few.statement, HasSubstr("20 of at least 21 states"));
    EXPECT_EQ(few.more, "The rule asks for 1 more initial state.");
    EXPECT_THAT(DecidedOnTwentyStates(rule + ", min_states: 20").statement, Not(HasSubstr("of at least")));
  }
  EXPECT_EQ(DecidedOnTwentyStates("test: paired_mcnemar, policy: good@c").states, 60) << "in JSON with seeds";
}

}  // namespace
}  // namespace evac
