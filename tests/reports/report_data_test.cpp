#include "reports/report_data.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/statistics/planning.h"
#include "reports/headlines.h"
#include "reports/methods.h"
#include "reports/page.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

ReportData LargeReport() { return ReportDataOf(LargeRun().Summary(), {.baseline = "pick@good"}); }

/// One policy, in twenty states: sim grasps in twelve where real does not.
const SampleRun& KindSim() {
  static const SampleRun run({{"take_bottle", "pick", "1", "ssssffffffffffffffff", "ssssssssssssssssffff"}});
  return run;
}

std::string AllText(const std::vector<Headline>& headlines) {
  std::string text;
  for (const Headline& headline : headlines) {
    text += headline.question + "\n";
    for (const HeadlineItem& item : headline.items) text += "[" + item.tag + "] " + item.text + "\n";
  }
  return text;
}

TEST(Stages, TheSharesOfAFunnelNeverRise) {
  const ReportData report = LargeReport();
  ASSERT_EQ(report.stages.funnels.size(), 8u) << "four policies, two tasks";
  for (const StageFunnel& funnel : report.stages.funnels) {
    ASSERT_EQ(funnel.worlds.size(), 2u);
    for (const StageRow& row : funnel.worlds) {
      ASSERT_FALSE(row.reached.empty());
      ASSERT_EQ(row.reached.size(), funnel.stages.size());
      for (std::size_t i = 1; i < row.reached.size(); ++i) EXPECT_LE(*row.reached[i].value, *row.reached[i - 1].value);
    }
  }
}

TEST(Stages, AWorldThatGraspsWhatRealDropsIsKinderAtGraspAndNowhereElse) {
  const StageReport stages = StagesOf(KindSim().Summary());
  ASSERT_EQ(stages.partings.size(), 2u);
  const StageParting& reach = stages.partings[0];
  const StageParting& grasp = stages.partings[1];
  EXPECT_EQ(reach.flips.only_first + reach.flips.only_second, 0);
  EXPECT_EQ(reach.pairs, 20);
  EXPECT_EQ(grasp.flips.only_first, 12);
  EXPECT_EQ(grasp.flips.only_second, 0);
  EXPECT_LT(*grasp.p_holm, 0.001);
  EXPECT_THAT(PartingInWords(grasp, "real"),
              HasSubstr("sim is kinder than real at grasp: of 20 pairs, 12 went on in sim alone"));
  EXPECT_THAT(PartingInWords(reach, "real"), HasSubstr("not decided at reach"));
}

TEST(Stages, APIsSaidBesideTheNumberOfPairsItIsOf) {
  std::vector<SampleCell> cells;  // in two states of ten all four policies go on in sim alone
  for (const char* checkpoint : {"1", "2", "3", "4"})
    cells.push_back({"take_bottle", "pick", checkpoint, "ffssssssss", "ssssssssss"});
  const StageReport stages = StagesOf(SampleRun(cells).Summary());
  ASSERT_EQ(stages.partings.size(), 2u);
  EXPECT_EQ(stages.partings[1].pairs, 40);
  EXPECT_THAT(PartingInWords(stages.partings[1], "real"),
              HasSubstr("of 40 pairs, 8 went on in sim alone and 0 in real alone (exact McNemar on 9 effective pairs"));
}

TEST(Stages, WithoutVerdictsThereIsNoFunnel) {
  const StageReport stages = StagesOf(SampleRun({{"a", "pick", "1", "uu", "uu"}}).Summary());
  EXPECT_TRUE(stages.funnels.empty());
  EXPECT_TRUE(stages.partings.empty());
}

TEST(Judges, AJudgeIsHeldAgainstPeopleInEachWorldApart) {
  SampleRun run({{"a", "pick", "1", "ssff", "ssff"}});
  std::vector<Verdict> verdicts;
  for (const Episode& episode : run.store().Episodes()) {
    const bool in_real = episode.key.world == "real";
    if (!in_real) continue;
    Verdict human;
    human.episode_id = episode.key.Id();
    human.judge = "human";
    human.label = episode.key.pair.initial_state == "41-0003" ? Label::kSuccess : Label::kFailure;
    verdicts.push_back(human);
    human.judge = "human:ann";
    verdicts.push_back(human);
  }
  run.store().AddVerdicts(verdicts);
  const JudgeReport judges = JudgesOf(run.Summary());
  EXPECT_EQ(judges.truth, "human");
  ASSERT_EQ(judges.judges.size(), 2u) << "a rater is not held against what her own vote made";
  EXPECT_EQ(judges.judges[0].world, "real");
  EXPECT_EQ(judges.judges[0].confusion.only_judge_success, 2);
  EXPECT_EQ(judges.judges[0].confusion.only_human_success, 1);
  EXPECT_EQ(judges.judges[0].confusion.both_failure, 1);
  EXPECT_TRUE(judges.judges[0].IsCalibrated());
  EXPECT_NEAR(*judges.judges[0].bias.value, 0.25, 1e-12) << "two of four too kind, one too hard";
  EXPECT_LT(judges.judges[0].bias.interval->low, 0) << "four episodes prove nothing";
  EXPECT_EQ(judges.judges[1].world, "sim");
  EXPECT_EQ(judges.judges[1].judged, 4);
  EXPECT_FALSE(judges.judges[1].IsCalibrated()) << "nobody looked at sim";
}

/// One label by people in real took the oracle away in sim: of the classifier there, "uncalibrated".
TEST(Judges, WherePeopleDidNotLookTheOracleIsStillTheBest) {
  SampleRun run({{"a", "pick", "1", "ssff", "ssff"}});
  std::vector<Verdict> verdicts;
  for (const Episode& episode : run.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "classifier:abc";
    verdict.label = episode.key.pair.initial_state == "41-0000" ? Label::kFailure : Label::kSuccess;
    verdicts.push_back(verdict);
    if (episode.key.world != "real") continue;
    for (const char* judge : {"human", "human:study:r1", "human:study:r2"}) {
      verdict.judge = judge;
      verdict.label = Label::kSuccess;
      verdicts.push_back(verdict);
    }
  }
  run.store().AddVerdicts(verdicts);
  const ReportData report = ReportDataOf(run.Summary());
  const std::vector<JudgeAgreement>& judges = report.judges.judges;
  ASSERT_EQ(judges.size(), 4u) << "classifier and oracle in both worlds";
  EXPECT_EQ(judges[0].world, "real");
  EXPECT_EQ(judges[0].against, "human");
  EXPECT_EQ(judges[0].confusion.both_success, 3);
  EXPECT_EQ(judges[1].world, "sim");
  EXPECT_EQ(judges[1].against, "oracle");
  EXPECT_EQ(judges[1].confusion.both_success, 1);
  EXPECT_EQ(judges[1].confusion.only_judge_success, 2);
  EXPECT_EQ(judges[1].confusion.only_human_success, 1);
  EXPECT_EQ(judges[3].judge, "oracle");
  EXPECT_EQ(judges[3].against, "human");
  EXPECT_FALSE(judges[3].IsCalibrated()) << "people did not look at sim";
  EXPECT_EQ(HeldAgainst(report.judges), "human in real, oracle in sim");
  EXPECT_THAT(MethodsParagraph(report), HasSubstr("Judges were held against human in real, oracle in sim, per world"));
  const std::string page = ReportPage(report, {"", "evac test"});
  EXPECT_THAT(page, HasSubstr("the best there is in its world: <b>human in real, oracle in sim</b>"));
  EXPECT_THAT(page, HasSubstr("Krippendorff’s alpha, of success and failure alone, ")) << "not as a session's board";
}

/// Nobody told an outcome in an imagined world: what stands there is held against the run's best, as before.
TEST(Judges, AnOracleThatCannotTellIsNoYardstick) {
  SampleRun run({{"a", "pick", "1", "sf", "??"}});
  std::vector<Verdict> verdicts;
  for (const Episode& episode : run.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "classifier:abc";
    verdict.label = Label::kSuccess;
    verdicts.push_back(verdict);
    verdict.judge = "human";
    if (episode.key.world == "real") verdicts.push_back(verdict);
  }
  run.store().AddVerdicts(verdicts);
  const JudgeReport judges = JudgesOf(run.Summary());
  for (const JudgeAgreement& judge : judges.judges) {
    EXPECT_EQ(judge.against, "human") << judge.judge << " in " << judge.world;
    EXPECT_EQ(judge.IsCalibrated(), judge.world == "real") << judge.judge;
  }
  EXPECT_EQ(HeldAgainst(judges), "human");
}

TEST(Checkpoints, TheirOrderIsThatOfTheNumbersInTheirNames) {
  EXPECT_EQ(StepOf("step_20000"), 20000);
  EXPECT_EQ(StepOf("120k"), 120000);
  EXPECT_EQ(StepOf("2M"), 2e6);
  EXPECT_EQ(StepOf("good"), std::nullopt);
  EXPECT_EQ(StepOf(""), std::nullopt);
  const SampleRun run({{"a", "pick", "s10", "sss", "sss"}, {"a", "pick", "s9", "fff", "fff"}});
  const std::vector<CheckpointCurve> curves = CheckpointsOf(run.Summary());
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_TRUE(curves[0].has_steps);
  EXPECT_EQ(curves[0].points[0].checkpoint, "s9") << "9 < 10, though \"s10\" < \"s9\"";
  EXPECT_THAT(TrendInWords(curves[0], 0), HasSubstr("In real, from s9 to s10: 0 % → 100 %, +100 points"));
  EXPECT_THAT(TrendInWords(curves[0], 0), HasSubstr("1 of 1 step rise"));
}

TEST(Checkpoints, ADecimalBeforeAUnitIsOfTheNumberAndElsewhereOfAVersion) {
  EXPECT_EQ(StepOf("0.5M"), 5e5);
  EXPECT_EQ(StepOf("step_1.5k"), 1500);
  EXPECT_EQ(StepOf("step.5k"), 5000) << "no digit before the point";
  EXPECT_EQ(StepOf("v1.10"), 10) << "after v1.5";
  const SampleRun run(
      {{"a", "pick", "0.5M", "fff", "fff"}, {"a", "pick", "1M", "sff", "sff"}, {"a", "pick", "2M", "sss", "sss"}});
  const std::vector<CheckpointCurve> curves = CheckpointsOf(run.Summary());
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_EQ(curves[0].points[0].checkpoint, "0.5M");
  EXPECT_THAT(TrendInWords(curves[0], 0), HasSubstr("In real, from 0.5M to 2M: 0 % → 100 %, +100 points"));
  EXPECT_THAT(TrendInWords(curves[0], 0), HasSubstr("2 of 2 steps rise"));
}

/// 31 January stood after 1 February, and v1.9 after v2.0: "the last against the first" said the opposite.
TEST(Checkpoints, WhoseNamesDifferByMoreThanANumberAtTheEndStandInTheOrderOfTheSuite) {
  for (const auto& [first, last] : {std::pair{"2026-01-31", "2026-02-01"},
                                    {"v1.9", "v2.0"},
                                    {"v9.1", "v10.0"},
                                    {"tuned", "base"},
                                    {"epoch=9-step=90", "epoch=10-step=100"}}) {
    const SampleRun run({{"a", "pick", last, "sss", "sss"}, {"a", "pick", first, "fff", "fff"}});
    RunData data = ReadRun(run.store());
    std::ranges::sort(data.policies, {}, [&](const PolicyInfo& policy) { return policy.checkpoint == last; });
    const std::vector<CheckpointCurve> curves = CheckpointsOf(Summarise(data, {}));
    ASSERT_EQ(curves.size(), 1u);
    EXPECT_FALSE(curves[0].has_steps);
    EXPECT_THAT(TrendInWords(curves[0], 0), HasSubstr(fmt::format("In real, from {} to {}: 0 % → 100 %", first, last)));
  }
  const SampleRun minor({{"a", "pick", "v1.10", "sss", "sss"}, {"a", "pick", "v1.9", "fff", "fff"}});
  EXPECT_EQ(CheckpointsOf(minor.Summary()).at(0).points[0].checkpoint, "v1.9") << "the number at the end alone differs";
}

TEST(Checkpoints, APolicyWithOneIsNoCurve) {
  EXPECT_TRUE(CheckpointsOf(SampleRun({{"a", "pick", "1", "s", "s"}}).Summary()).empty());
}

TEST(Headlines, AnswerWorseWhereTrustAndNextInThatOrder) {
  const std::vector<Headline> headlines = HeadlinesOf(LargeReport());
  ASSERT_EQ(headlines.size(), 4u);
  EXPECT_EQ(headlines[0].question, "Is any policy worse than pick@good?");
  EXPECT_EQ(headlines[1].question, "Where?");
  EXPECT_EQ(headlines[2].question, "Can I trust sim to within ±10 points?");
  EXPECT_EQ(headlines[3].question, "What next?");
  for (const Headline& headline : headlines) EXPECT_FALSE(headline.items.empty()) << headline.question;
}

TEST(Headlines, AClearLossIsWorseWithItsNumbersAndASmallOneIsNotDecided) {
  const std::string text = AllText(HeadlinesOf(LargeReport()));
  EXPECT_THAT(text, HasSubstr("[worse] pick@blind: 5 % against 85 %, -80 points"));
  const SampleRun small({{"a", "pick", "good", "sssf", "sssf"}, {"a", "pick", "new", "ssff", "sssf"}});
  const std::string small_text = AllText(HeadlinesOf(ReportDataOf(small.Summary())));
  EXPECT_THAT(small_text, HasSubstr("Is pick@new worse than pick@good?"));
  EXPECT_THAT(small_text, HasSubstr("[not decided] pick@new: 50 % against 75 %"));
  EXPECT_THAT(small_text, Not(HasSubstr("[worse]")));
}

/// Better at either task, and run more often on the hard one: the rates of all episodes say the opposite.
TEST(Headlines, ADifferenceOverTasksIsSaidToBeTaskByTask) {
  const std::string easy = "sssssssssf--", hard = "ff----------", easy_new = "----------ss", hard_new = "--sffffffffs";
  const SampleRun run({{"a", "pick", "good", easy, easy},
                       {"b", "pick", "good", hard, hard},
                       {"a", "pick", "new", easy_new, easy_new},
                       {"b", "pick", "new", hard_new, hard_new}});
  const ReportData report = ReportDataOf(run.Summary(), {.baseline = "pick@good"});
  const std::string text = AllText(HeadlinesOf(report));
  EXPECT_THAT(text, HasSubstr("pick@new: 33 % against 75 %, +")) << text;
  EXPECT_THAT(text, HasSubstr("] task by task (12 and 12 episodes, p = "));
  EXPECT_THAT(AllText(HeadlinesOf(LargeReport())), Not(HasSubstr("task by task"))) << "pairs stay within their task";
}

TEST(Headlines, WhereHoldsATaskToAllCandidatesAsTheFirstAnswerDoes) {
  // Six flips to none: p = .031 alone, and not significant as one of three.
  const std::string good = "ssssssffff", bad = "ffffffffff";
  std::vector<SampleCell> cells = {{"a", "pick", "good", good, good}, {"a", "pick", "x", bad, bad}};
  EXPECT_THAT(AllText(HeadlinesOf(ReportDataOf(SampleRun(cells).Summary()))),
              HasSubstr("[worse] a: pick@x -60 points"));
  cells.push_back({"a", "pick", "y", bad, bad});
  cells.push_back({"a", "pick", "z", bad, bad});
  const ReportData report = ReportDataOf(SampleRun(cells).Summary());
  ASSERT_EQ(report.candidates.size(), 3u);
  for (const Candidate& candidate : report.candidates) {
    ASSERT_EQ(candidate.task_p_holm.size(), 1u);
    EXPECT_EQ(*candidate.task_p_holm[0], *candidate.p_holm) << "of one task: the same test";
    EXPECT_NEAR(*candidate.p_holm, 3 * 2.0 / 64, 1e-12);
  }
  const std::string text = AllText(HeadlinesOf(report));
  EXPECT_THAT(text, HasSubstr("[not decided] pick@x: 0 % against 60 %"));
  EXPECT_THAT(text, HasSubstr("[not decided] a: no difference that these episodes can show"));
  EXPECT_THAT(text, Not(HasSubstr("[worse]")));
}

TEST(Headlines, HowManyMoreIsPlannedAtACandidatesShareOfAlpha) {
  const std::string good = "ssssffffss", less = "sfsfffffss";
  const SampleRun run({{"a", "pick", "good", good, good}, {"a", "pick", "x", less, less}, {"a", "pick", "y", less, less}});
  const ReportData report = ReportDataOf(run.Summary());
  ASSERT_EQ(report.candidates.size(), 2u);
  const FlipRates rates{0.5 / 11, 2.5 / 11};
  for (const Candidate& candidate : report.candidates) {
    ASSERT_TRUE(candidate.more);
    EXPECT_GE(McNemarPower(10 + *candidate.more, rates, 0.025), 0.8);
    EXPECT_LT(McNemarPower(10 + *candidate.more - 1, rates, 0.025), 0.8);
  }
  EXPECT_THAT(AllText(HeadlinesOf(report)),
              HasSubstr(fmt::format("About {} more pairs would decide on pick@x", *report.candidates[0].more)));
}

TEST(Headlines, TheBaselineCanBeNamedAndMustBeAPolicyOfTheRun) {
  const ReportData report = ReportDataOf(LargeRun().Summary(), {.baseline = "pick@blind"});
  EXPECT_THAT(AllText(HeadlinesOf(report)), HasSubstr("[better] pick@good: 85 % against 5 %"));
  try {
    ReportDataOf(LargeRun().Summary(), {.baseline = "pick"});
    FAIL() << "pick is no policy without its checkpoint";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("found pick, wanted a policy of the run: pick@biased, pick@blind"));
  }
}

TEST(Headlines, EveryRunHasAllFourAnswers) {
  for (const char* outcomes : {"s", "u", "e", "?"}) {
    const ReportData report = ReportDataOf(SampleRun({{"a", "pick", "1", outcomes, outcomes}}).Summary());
    const std::vector<Headline> headlines = HeadlinesOf(report);
    ASSERT_EQ(headlines.size(), 4u);
    for (const Headline& headline : headlines) EXPECT_FALSE(headline.items.empty()) << outcomes;
  }
}

TEST(Headlines, WhoIsMissingIsAskedByACommandThatTheProgramTakes) {
  const SampleRun run({{"a", "pick", "1", "uu", "uu"}});
  const auto text = [&run](const std::string& judge) {
    return AllText(HeadlinesOf(ReportDataOf(run.Summary({.judge = judge}))));
  };
  EXPECT_THAT(text("oracle"), HasSubstr("4 episodes are not judged yet: evac judge RUN --judge oracle"));
  EXPECT_THAT(text("classifier:1a2b"), HasSubstr("yet: evac judge RUN --judge classifier --weights FILE"));
  EXPECT_THAT(text("vlm:qwen"), HasSubstr("yet: evac judge RUN --judge vlm --config PAGE"));
  EXPECT_THAT(text("human"), HasSubstr("yet: evac rate new STUDY --run RUN, then evac rate serve STUDY, then evac rate "
                                       "resolve STUDY (a study's examples and practice clips get no label)"));
}

TEST(Methods, NameTheTestsThatWereUsedAndNoOthers) {
  const std::string text = MethodsParagraph(LargeReport());
  EXPECT_THAT(text, HasSubstr("4 policies on 2 tasks in 2 worlds (real (the reference), sim)"));
  EXPECT_THAT(text, HasSubstr("exact McNemar"));
  EXPECT_THAT(text, HasSubstr("paired by initial state and seed"));
  EXPECT_THAT(text, HasSubstr("paired state bootstrap"));
  EXPECT_THAT(text, HasSubstr("Holm-adjusted over the 3 comparisons, those of single tasks over all 6 of them. "));
  EXPECT_THAT(text, Not(HasSubstr("Boschloo")));
  EXPECT_THAT(text, HasSubstr("No episode was excluded."));
  const SampleRun apart({{"a", "pick", "1", "ssffe", "-----"}, {"a", "pick", "2", "-----ssff", "---------"}});
  const std::string unpaired = MethodsParagraph(ReportDataOf(apart.Summary()));
  EXPECT_THAT(unpaired, HasSubstr("Boschloo"));
  EXPECT_THAT(unpaired, Not(HasSubstr("paired by initial state")));
  EXPECT_THAT(unpaired, HasSubstr("Excluded from all rates: 1 error."));
}

TEST(Checkpoints, OnlyNeighboursThatBothHaveARateAreSteps) {
  const SampleRun gaps(
      {{"a", "pick", "s1", "-", "ss"}, {"a", "pick", "s2", "-", "uu"}, {"a", "pick", "s3", "-", "ff"}});
  const CheckpointCurve apart = CheckpointsOf(gaps.Summary()).at(0);
  EXPECT_THAT(TrendInWords(apart, 1), HasSubstr("; no two neighbours are judged."));
  const SampleRun run({{"a", "pick", "s1", "-", "ff"},
                       {"a", "pick", "s2", "-", "uu"},
                       {"a", "pick", "s3", "-", "ff"},
                       {"a", "pick", "s4", "-", "ss"}});
  EXPECT_THAT(TrendInWords(CheckpointsOf(run.Summary()).at(0), 1), HasSubstr("; 1 of 1 step rise."));
}

TEST(Headlines, ARunWithoutAPolicyHasNotOne) {
  RunData data = ReadRun(SampleRun({{"a", "pick", "1", "s", "s"}}).store());
  data.policies.clear();
  data.episodes.clear();
  data.verdicts.clear();
  const std::string text = AllText(HeadlinesOf(ReportDataOf(Summarise(std::move(data), {}))));
  EXPECT_THAT(text, HasSubstr("The run has no policy yet"));
  EXPECT_THAT(text, Not(HasSubstr("one policy")));
}

TEST(Headlines, ClipsThatTheJudgeWasShownSmallAreCountedByNamingBoth) {
  RunData data = ReadRun(SampleRun({{"a", "pick", "1", "-", "uu"}}).store());
  ASSERT_EQ(data.episodes.size(), 2u);
  const auto judge = [&](std::size_t episode, const std::string& name) {
    Verdict& verdict = data.verdicts[data.episodes[episode].key.Id()][name];
    verdict.episode_id = data.episodes[episode].key.Id();
    verdict.judge = name;
    verdict.label = Label::kSuccess;
  };
  judge(0, "vlm:x");
  RunData without = data;
  judge(1, "vlm:x:small");
  const std::string wanted = "evac report RUN --judge vlm:x,vlm:x:small";
  const ReportData report = ReportDataOf(Summarise(data, {.judge = "vlm"}));
  EXPECT_THAT(AllText(HeadlinesOf(report)), HasSubstr("1 episode is not judged yet: " + wanted));
  EXPECT_THAT(ReportPage(report, {"", "evac test"}), HasSubstr("<code>" + wanted + "</code> counts these"));
  EXPECT_THAT(ReportPage(ReportDataOf(Summarise(data, {.judge = "vlm:x,vlm:x:small"})), {"", "evac test"}),
              Not(HasSubstr("no verdict by")));
  EXPECT_THAT(AllText(HeadlinesOf(ReportDataOf(Summarise(without, {.judge = "vlm"})))),
              HasSubstr("evac judge RUN --judge vlm --config PAGE"));
}

}  // namespace
}  // namespace evac
