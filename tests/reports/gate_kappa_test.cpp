#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "reports/gate.h"
#include "tests/reports/repeated_run.h"

/// A judge that never differed from another: kappa is 1, and nothing shows its spread.
namespace evac {
namespace {

using testing::HasSubstr;

/// @param sim  the oracle's outcomes, which the human saw likewise
RuleDecision HeldAgainstItself(const std::string& sim, const std::string& rule) {
  RunSummary run = RepeatedRun({{"t", "p", {}, {sim}}});
  run.judges.push_back("human");
  for (auto& [episode, verdicts] : run.data.verdicts) verdicts["human"] = verdicts.at("oracle");
  const GateRules rules = ReadGateRules(
      Config::FromText("gates: [{name: r, test: judge_kappa, world: sim, " + rule + "}]\n", "gate.yaml"));
  return Decide(rules, {run, "out", {}}, nullptr).decision.rules.at(0);
}

std::string Half(int states) {
  const auto half = static_cast<std::size_t>(states / 2);
  return std::string(half, 's') + std::string(static_cast<std::size_t>(states) - half, 'f');
}

TEST(GateOfAnUnerringJudge, PassesInManyStatesAndIsInconclusiveInFew) {
  const RuleDecision many = HeldAgainstItself(Half(40), "at_least: 0.6");
  EXPECT_EQ(many.outcome, GateOutcome::kPass) << many.statement;
  EXPECT_THAT(many.statement, HasSubstr("1.00 [0.86, 1.00] (90 %) over 40 episodes"));
  EXPECT_EQ(many.more, "");
  const RuleDecision few = HeldAgainstItself(Half(5), "at_least: 0.6");
  EXPECT_EQ(few.outcome, GateOutcome::kInconclusive) << few.statement;
  EXPECT_THAT(few.more, HasSubstr("The two never differed, but in 5 initial states only: "));
}

TEST(GateOfAnUnerringJudge, AsksForAsManyStatesAsItsThresholdAndAlphaTake) {
  EXPECT_EQ(HeldAgainstItself(Half(14), "at_least: 0.6").outcome, GateOutcome::kPass) << ".8^14 < .05";
  EXPECT_EQ(HeldAgainstItself(Half(12), "at_least: 0.6").outcome, GateOutcome::kInconclusive) << ".8^12 > .05";
  EXPECT_THAT(HeldAgainstItself(Half(12), "at_least: 0.6").more, HasSubstr(": 14 of which none differs would show"));
  EXPECT_EQ(HeldAgainstItself(Half(14), "at_least: 0.6, alpha: 0.01").outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(HeldAgainstItself(Half(40), "at_least: 1").more, HasSubstr("no number of them would show it."));
}

TEST(GateOfAnUnerringJudge, IsAskedForMoreStatesWhereNearlyAllEndAlike) {
  const std::string lopsided = std::string(38, 's') + "ff";
  EXPECT_EQ(HeldAgainstItself(lopsided, "at_least: 0.6").outcome, GateOutcome::kInconclusive)
      << "two failures show little of how it sees failures";
}

/// "against: classifier" was refused although `judge: classifier` beside it was understood.
TEST(GateOfAnUnerringJudge, TheOtherJudgeMayBeCalledByItsShortName) {
  RunSummary run = RepeatedRun({{"t", "p", {}, {Half(40)}}});
  run.judges.push_back("classifier:0123456789ab");
  for (auto& [episode, verdicts] : run.data.verdicts) verdicts["classifier:0123456789ab"] = verdicts.at("oracle");
  const GateRules rules = ReadGateRules(Config::FromText(
      "gates: [{name: r, test: judge_kappa, world: sim, at_least: 0.6, against: classifier}]\n", "gate.yaml"));
  const RuleDecision decision = Decide(rules, {run, "out", {}}, nullptr).decision.rules.at(0);
  EXPECT_EQ(decision.outcome, GateOutcome::kPass) << decision.statement;
  EXPECT_THAT(decision.statement, HasSubstr("kappa of oracle with classifier:0123456789ab in sim"));
  run.judges.push_back("classifier:ba9876543210");
  EXPECT_THAT([&] { Decide(rules, {run, "out", {}}, nullptr); },
              testing::ThrowsMessage<Error>(HasSubstr("gate rule 'r': against: judge 'classifier': stands for")));
}

TEST(GateOfAnUnerringJudge, OneAnswerAloneIsNoKappa) {
  const RuleDecision constant = HeldAgainstItself(std::string(40, 's'), "at_least: 0.6");
  EXPECT_EQ(constant.outcome, GateOutcome::kInconclusive);
  EXPECT_THAT(constant.statement, HasSubstr("both always gave the same one answer"));
}

/// By `judge: human` a rule held human against human, the default of `against`: a kappa of 1.00 that passed.
TEST(GateOfAnUnerringJudge, NobodyIsHeldAgainstThemselves) {
  RunSummary run = RepeatedRun({{"t", "p", {}, {Half(40)}}});
  for (auto& [episode, verdicts] : run.data.verdicts) verdicts["human"] = verdicts.at("oracle");
  const GateRules rules = ReadGateRules(
      Config::FromText("gates: [{name: r, test: judge_kappa, world: sim, at_least: 0.6}]\n", "gate.yaml"));
  for (const std::string judge : {"human", "oracle,human"}) {
    const RunSummary judged = Summarise(run.data, {.judge = judge, .bootstrap_replicates = 1});
    EXPECT_THAT([&] { Decide(rules, {judged, "out", {}}, nullptr); },
                testing::ThrowsMessage<Error>("gate rule 'r': against: found 'human', wanted another than the rules' "
                                              "own judge, " + judge));
  }
}

}  // namespace
}  // namespace evac
