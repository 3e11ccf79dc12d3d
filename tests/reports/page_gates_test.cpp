#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "reports/dashboard_pages.h"
#include "reports/gate.h"
#include "reports/gate_output.h"
#include "reports/headlines.h"
#include "reports/page.h"
#include "reports/report_json.h"
#include "reports/summary_md.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(GatesOnThePage, MoreCounterExamplesThanAreKeptAreCountedAllTheSame) {
  const std::string all(210, 's'), none(210, 'f');
  const PinnedResult pinned = Pin(RepeatedRun({{"take", "p", {}, {all}}}), "out/main");
  const GateRules rules =
      ReadGateRules(Config::FromText("gates:\n  - {name: r, test: paired_mcnemar, world: sim}\n", "gate.yaml"));
  const RunSummary now = RepeatedRun({{"take", "p", {}, {none}}});
  const GateDecision decision = Decide(rules, {now, "out/candidate", {}}, &pinned).decision;
  ASSERT_EQ(decision.rules.at(0).counter_examples.size(), 200u);
  EXPECT_EQ(decision.rules.at(0).flips_worse, 210);
  ReportData report = ReportDataOf(SampleRun({{"take", "p", "c", "s", "s"}}).Summary());
  report.gates = {{decision, true}};
  EXPECT_THAT(ReportPage(report, {"", "evac test"}), HasSubstr("210 counter-examples, the first 12"));
  EXPECT_THAT(SummaryMarkdown(now, report.gates),
              HasSubstr("r: 210 pairs where only the baseline succeeded, the first 200<"));
}

/// The page of a run that failed a gate in all its six states. @param run  as whoever asked for the decision named it.
std::string PageOfAFailedGate(const std::string& run, const std::string& run_folder) {
  SampleRun now({{"take_bottle", "pick", "good", "-", "ffffff"}});
  const SampleRun then({{"take_bottle", "pick", "good", "-", "ssssss"}});
  const PinnedResult pinned = Pin(then.Summary({.bootstrap_replicates = 1}), "out/main");
  const GateRules rules = ReadGateRules(
      Config::FromText("gates:\n  - {name: r, test: paired_mcnemar, world: sim, margin: 0.1}\n", "gate.yaml"));
  const GateDecision decision = Decide(rules, {now.Summary({.bootstrap_replicates = 1}), run, {}}, &pinned).decision;
  EXPECT_EQ(decision.rules.at(0).counter_examples.size(), 6u);
  now.store().AddGateRecord({decision.Key(), decision.name, Name(decision.outcome), JsonOf(decision).dump()}, {});
  return ReportPage(ReportDataOf(now.Summary({.bootstrap_replicates = 1})), {run_folder, "evac test"});
}

TEST(GatesOnThePage, CounterExamplesLinkTheClipsOfTheRunWhereverItWasNamed) {
  for (const char* run : {"out/candidate", "/data/runs/videos", "."}) {
    const std::string page = PageOfAFailedGate(run, "..");
    EXPECT_THAT(page, HasSubstr("<a href=\"../videos/sim/take_bottle/pick@good/41-0000-s1.mp4\">candidate failed"))
        << run;
    EXPECT_THAT(page, AllOf(Not(HasSubstr("candidate/videos")), Not(HasSubstr("runs/videos")))) << run;
  }
  EXPECT_THAT(PageOfAFailedGate("out/candidate", ""),
              HasSubstr("<a href=\"videos/sim/take_bottle/pick@good/41-0000-s1.mp4\">candidate failed"));
}

TEST(GatesOnThePage, ADecisionByAnotherJudgeThanThePagesNamesIts) {
  SampleRun now({{"take_bottle", "pick", "good", "-", "ffffff"}});
  for (const Episode& episode : now.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "human";
    verdict.label = Label::kSuccess;
    now.store().AddVerdict(verdict);
  }
  const GateRules rules =
      ReadGateRules(Config::FromText("gates: [{name: r, test: ci_lower, world: sim, at_least: 0.9}]\n", "gate.yaml"));
  const GateDecision decision =
      Decide(rules, {now.Summary({.bootstrap_replicates = 1}), "out/now", {}}, nullptr).decision;
  EXPECT_EQ(decision.judge, "oracle");
  EXPECT_THAT(GateText(decision), HasSubstr("Gate gate: fail. Judge oracle. Data "));
  now.store().AddGateRecord({decision.Key(), decision.name, Name(decision.outcome), JsonOf(decision).dump()}, {});
  const ReportData report = ReportDataOf(now.Summary({.judge = "human", .bootstrap_replicates = 1}));
  const std::string page = ReportPage(report, {"", "evac test"});
  EXPECT_THAT(page, HasSubstr("gate gate (judge oracle): "));
  EXPECT_THAT(page, HasSubstr("<p class=\"quiet\">Judge oracle. Rules"));
  EXPECT_THAT(SummaryMarkdown(report.summary, report.gates), HasSubstr("## Gate gate: fail\n\nJudge oracle.\n"));
  const auto json = nlohmann::json::parse(ReportJson(report.summary, "evac test"));
  EXPECT_EQ(json.at("gates").at(0).at("judge"), "oracle");
  EXPECT_THAT(ReportPage(ReportDataOf(now.Summary({.bootstrap_replicates = 1})), {"", "evac test"}),
              Not(HasSubstr("(judge oracle)")))
      << "the page's own";
}

ShownGate GateOf(const std::string& name, GateOutcome outcome, bool is_current = true) {
  ShownGate gate{{}, is_current};
  gate.decision.name = name;
  gate.decision.outcome = outcome;
  return gate;
}

/// The first by name was shown, and a gate that failed was hidden behind it.
TEST(GatesOnThePage, TheDashboardsLineIsThatOfTheGravestGate) {
  ReportData report = ReportDataOf(SampleRun({{"take", "p", "c", "s", "s"}}).Summary());
  const auto verdict = [&report] { return DashboardRunOf("monday", report).verdict; };
  report.gates = {GateOf("alpha", GateOutcome::kPass)};
  EXPECT_EQ(verdict(), "pass: gate alpha");
  report.gates.push_back(GateOf("beta", GateOutcome::kPass, false));
  EXPECT_EQ(verdict(), "pass: gate beta (of older data)");
  report.gates.push_back(GateOf("gamma", GateOutcome::kInconclusive));
  EXPECT_EQ(verdict(), "inconclusive: gate gamma");
  report.gates.push_back(GateOf("omega", GateOutcome::kFail));
  EXPECT_EQ(verdict(), "fail: gate omega");
  EXPECT_EQ(HeadlinesOf(report).front().items.at(3).text, "gate alpha") << "the others follow";
}

TEST(GatesOnThePage, ADecisionThatWasKeptWithoutItsJudgeIsReadAllTheSame) {
  GateDecision decision;
  decision.judge = "oracle";
  nlohmann::ordered_json json = JsonOf(decision);
  json.erase("judge");
  EXPECT_EQ(GateDecisionFromJson(json.dump()).judge, "");
}

}  // namespace
}  // namespace evac
