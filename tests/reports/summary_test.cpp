#include "reports/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/statistics/rates.h"
#include "reports/counted_judges.h"
#include "reports/page.h"
#include "reports/report_data.h"
#include "reports/report_json.h"
#include "reports/run_correlation.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

const RateCell& CellOf(const RunSummary& summary, const std::string& policy, const std::string& world) {
  for (const RateCell& cell : summary.rates) {
    if (cell.policy == policy && cell.world == world) return cell;
  }
  throw InternalError("no cell {} {}", policy, world);
}

TEST(Summary, OnlySuccessesAndFailuresAreInARate) {
  SampleRun run({{"take_bottle", "pick", "good", "sssf?ieu", "ssss"}});
  const RunSummary summary = run.Summary();
  const RateCell& real = CellOf(summary, "pick@good", "real");
  EXPECT_EQ(real.rate.n, 4);
  EXPECT_EQ(*real.rate.value, 0.75);
  EXPECT_EQ(real.rate.interval->low, WilsonInterval(3, 4).interval->low);
  EXPECT_EQ(real.Of(Outcome::kCannotTell), 1);
  EXPECT_EQ(real.Of(Outcome::kInvalid), 1);
  EXPECT_EQ(real.Of(Outcome::kError), 1);
  EXPECT_EQ(real.Of(Outcome::kUnjudged), 1);
  EXPECT_EQ(real.Apart(), 4);
}

TEST(Summary, APolicyWithoutCheckpointStandsWhereTheSuiteNamesIt) {
  SampleRun run({{"take_bottle", "alpha", "b", "s", "s"},
                 {"take_bottle", "alpha", "default", "s", "s"},
                 {"take_bottle", "main", "default", "s", "s"}});
  RunData data = ReadRun(run.store());
  data.run.suite_text = "policies:\n  - {name: main}\n  - {name: alpha}\n  - {name: alpha, checkpoint: b}\n";
  const RunSummary summary = Summarise(std::move(data), {});
  EXPECT_THAT(summary.policies, testing::ElementsAre("main@default", "alpha@default", "alpha@b"));
  EXPECT_EQ(ReportDataOf(summary).baseline, "main@default") << "the first declared";
}

TEST(Summary, ARateWithoutVerdictsIsUndefinedAndNotZero) {
  SampleRun run({{"take_bottle", "pick", "good", "uue", "sf"}});
  const RunSummary summary = run.Summary();
  const RateCell& real = CellOf(summary, "pick@good", "real");
  EXPECT_FALSE(real.rate.value);
  EXPECT_FALSE(real.rate.value.reason().empty());
}

TEST(Summary, AnErrorStaysAnErrorWhateverAJudgeSays) {
  SampleRun run({{"take_bottle", "pick", "good", "es", "ss"}});
  Verdict verdict;
  verdict.episode_id = EpisodeKey{{"take_bottle", "41-0000", "pick", "good", 1}, "real"}.Id();
  verdict.judge = "oracle";
  verdict.label = Label::kSuccess;
  run.store().AddVerdict(verdict);
  EXPECT_EQ(CellOf(run.Summary(), "pick@good", "real").Of(Outcome::kError), 1);
}

void Say(Store& store, const std::string& world, const std::string& judge, Label label) {
  for (const Episode& episode : store.Episodes()) {
    if (episode.key.world != world) continue;
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = judge;
    verdict.label = label;
    store.AddVerdict(verdict);
  }
}

TEST(Summary, OfSeveralJudgesTheFirstThatCanTellCountsEpisodeByEpisode) {
  SampleRun run({{"take_bottle", "pick", "good", "ssf?", "u?uu"}});
  Say(run.store(), "real", "classifier:abc", Label::kFailure);
  Say(run.store(), "sim", "classifier:abc", Label::kSuccess);
  SummaryOptions options;
  options.judge = "oracle,classifier";
  const RunSummary summary = Summarise(ReadRun(run.store()), options);
  EXPECT_EQ(summary.options.judge, "oracle,classifier:abc");
  EXPECT_EQ(CellOf(summary, "pick@good", "real").Of(Outcome::kSuccess), 2);
  EXPECT_EQ(CellOf(summary, "pick@good", "real").Of(Outcome::kFailure), 2) << "the oracle could not tell of one";
  EXPECT_EQ(CellOf(summary, "pick@good", "sim").Of(Outcome::kSuccess), 4);
  EXPECT_TRUE(RatesOfOtherJudges(summary).empty()) << "both are counted already";

  RunCorrelationOptions correlation;
  correlation.judge = options.judge;
  const CorrelationGroup group = CorrelateRun(run.store(), correlation).at(0);
  ASSERT_EQ(group.points.size(), 1u);
  EXPECT_EQ(group.points[0].real_sr, 0.5);
  EXPECT_EQ(group.points[0].sim_sr, 1);

  const RunSummary oracle = Summarise(ReadRun(run.store()), {});
  EXPECT_EQ(CellOf(oracle, "pick@good", "sim").Of(Outcome::kUnjudged), 3);
  EXPECT_EQ(RatesOfOtherJudges(oracle).size(), 1u);
}

TEST(Summary, AJudgesShortNameStandsForOneOrIsRefused) {
  const std::vector<std::string> there = {"classifier:abc", "classifier:def", "oracle", "vlm:x", "vlm:x:flip"};
  EXPECT_EQ(FullJudgeNames("vlm", there), "vlm:x");
  EXPECT_EQ(FullJudgeNames("vlm", {"oracle", "vlm:x:flip:small", "vlm:x:small"}), "vlm:x:small") << "a probe is nobody's name";
  EXPECT_EQ(FullJudgeNames("classifier:def,oracle", there), "classifier:def,oracle");
  EXPECT_EQ(FullJudgeNames("nobody", there), "nobody");
  EXPECT_THROW(FullJudgeNames("oracle,classifier", there), Error);
  EXPECT_THROW(FullJudgeNames("oracle,", there), Error);
  EXPECT_EQ(JudgeWords("oracle,vlm:x"), "oracle, else vlm:x");
  EXPECT_EQ(LastJudge("oracle,vlm:x"), "vlm:x");
}

TEST(Summary, EveryKindOfJudgeHasItsCommands) {
  EXPECT_THAT(JudgingCommands("oracle"), testing::ElementsAre("evac judge RUN --judge oracle"));
  EXPECT_EQ(JudgingCommands("classifier"), JudgingCommands("classifier:1a2b"));
  EXPECT_EQ(JudgingCommands("vlm"), JudgingCommands("vlm:qwen-1a2b3c4d"));
  EXPECT_EQ(JudgingCommands("human").back(), "evac rate resolve STUDY");
  EXPECT_EQ(JudgingCommands("human:pilot:r3").back(), "evac rate resolve STUDY --each-rater");
  EXPECT_EQ(JudgingCommands("second").back(), "evac rate resolve STUDY --as second");
  for (const char* program : {"oracle", "classifier:1a2b", "vlm"}) EXPECT_EQ(NeverJudged(program), "");
  for (const char* people : {"human", "second"}) EXPECT_THAT(NeverJudged(people), testing::HasSubstr("get no label"));
}

TEST(Summary, OtherJudgesCountTheSameEpisodesWithTheirOwnVerdicts) {
  SampleRun run({{"take_bottle", "pick", "good", "sse", "ss"}, {"take_bottle", "pick", "bad", "fff", "ff"}});
  for (const Episode& episode : run.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.label = episode.key.pair.checkpoint == "bad" ? Label::kSuccess : Label::kFailure;
    for (const std::string judge : {"human", "human:ann"}) {
      verdict.judge = judge;
      run.store().AddVerdict(verdict);
    }
  }
  const RunSummary summary = run.Summary();
  const std::vector<JudgeRates> others = RatesOfOtherJudges(summary);
  ASSERT_EQ(others.size(), 1u) << "one rater's votes are no judge of their own";
  EXPECT_EQ(others[0].judge, "human");
  const std::vector<RateCell> counted = run.Summary({.judge = "human"}).rates;
  ASSERT_EQ(others[0].rates.size(), counted.size());
  for (std::size_t i = 0; i < counted.size(); ++i) {
    EXPECT_EQ(others[0].rates[i].policy, counted[i].policy);
    EXPECT_EQ(others[0].rates[i].counts, counted[i].counts);
    EXPECT_EQ(*others[0].rates[i].rate.value, counted[i].policy == "pick@bad" ? 1 : 0);
  }
  const std::string page = ReportPage(summary, {".", "evac test"});
  EXPECT_THAT(page, testing::HasSubstr("id=\"rates-judge-1\">"));
  EXPECT_THAT(page, testing::HasSubstr("As <b>human</b> sees the same episodes"));
}

TEST(Summary, CountsOneJudgeAndItsLastWord) {
  SampleRun run({{"take_bottle", "pick", "good", "ss", "ss"}});
  Verdict verdict;
  verdict.episode_id = EpisodeKey{{"take_bottle", "41-0000", "pick", "good", 1}, "real"}.Id();
  verdict.judge = "human";
  verdict.label = Label::kFailure;
  run.store().AddVerdict(verdict);
  EXPECT_EQ(*CellOf(run.Summary(), "pick@good", "real").rate.value, 1.0);
  EXPECT_EQ(*CellOf(run.Summary({.judge = "human"}), "pick@good", "real").rate.value, 0.0);
  verdict.judge = "oracle";
  run.store().AddVerdict(verdict);
  EXPECT_EQ(*CellOf(run.Summary(), "pick@good", "real").rate.value, 0.5);
  EXPECT_EQ(run.Summary().judges, (std::vector<std::string>{"human", "oracle"}));
}

TEST(Summary, RefusesAnImpossibleConfidence) {
  SampleRun run({{"take_bottle", "pick", "good", "s", "s"}});
  EXPECT_THROW(run.Summary({.confidence = 1.0}), Error);
  EXPECT_THROW(run.Summary({.bootstrap_replicates = 0}), Error);
}

TEST(Comparison, PairsAreMadeByKeyAndCountedInFourCells) {
  SampleRun run({{"take_bottle", "pick", "good", "ssffsse-s", "sfsff?ss-"}});
  const RunSummary summary = run.Summary();
  ASSERT_EQ(summary.comparisons.size(), 1u);
  ASSERT_EQ(summary.comparisons[0].tables.size(), 1u);
  const PairTable& table = summary.comparisons[0].tables[0];
  EXPECT_EQ(table.both_succeed, 1);
  EXPECT_EQ(table.real_only, 2);
  EXPECT_EQ(table.other_only, 1);
  EXPECT_EQ(table.both_fail, 1);
  EXPECT_EQ(table.uncounted, 2) << "one error, one cannot tell";
  EXPECT_EQ(table.unpaired, 2) << "one in each world";
  EXPECT_EQ(table.test.p_exact, 1.0);
  EXPECT_EQ(*table.agreement.value, 0.4);
  for (const EpisodePair& pair : table.pairs) {
    EXPECT_EQ(summary.episodes[pair.real].episode.key.pair, summary.episodes[pair.other].episode.key.pair);
    EXPECT_EQ(summary.episodes[pair.real].episode.key.world, "real");
    EXPECT_EQ(summary.episodes[pair.other].episode.key.world, "sim");
  }
}

TEST(Comparison, RepeatsOfOneStateDoNotMakeItsTestSurer) {
  const RunSummary summary = RepeatedRun({{"a", "p", Alike(10, "ssss"), Alike(10, "sfff")}});
  const PairTable& table = summary.comparisons.at(0).tables.at(0);
  EXPECT_EQ(table.real_only, 30) << "what is shown are all pairs";
  EXPECT_EQ(table.effective_pairs, 3);
  EXPECT_NEAR(table.test.p_exact, 0.5, 1e-12) << "2 flips to none";
  EXPECT_THAT(ReportPage(summary, {".", "evac test"}),
              testing::HasSubstr("Exact McNemar on 3 effective pairs: p = 0.50"));
  const auto json = nlohmann::json::parse(ReportJson(summary, "evac test"));
  EXPECT_EQ(json["comparisons"][0]["pairs"][0]["effective_pairs"], 3);
  EXPECT_NEAR(json["comparisons"][0]["pairs"][0]["mcnemar_p_exact"].get<double>(), 0.5, 1e-12);
}

TEST(Comparison, TheReportSaysWhatCorrelateSays) {
  std::vector<SampleCell> cells = FourPoliciesTwoTasks();
  cells[1].real = "sssssseff?";  // states that do not count, in one world only
  SampleRun run(cells);
  const CorrelationGroup report = run.Summary().comparisons.at(0).correlation;
  const CorrelationGroup command = CorrelateRun(run.store()).at(0);
  ASSERT_TRUE(report.pearson.value && report.pearson.interval);
  EXPECT_EQ(report.points.size(), 8u);
  EXPECT_EQ(*report.pearson.value, *command.pearson.value);
  EXPECT_EQ(report.pearson.interval->low, command.pearson.interval->low);
  EXPECT_EQ(report.pearson.interval->high, command.pearson.interval->high);
  EXPECT_EQ(*report.mmrv.value, *command.mmrv.value);
  EXPECT_EQ(report.mmrv.interval->high, command.mmrv.interval->high);
  EXPECT_EQ(report.pearson.method, command.pearson.method);
}

TEST(Comparison, ThePointsRatesAreThoseOfTheirPairs) {
  SampleRun run({{"take_bottle", "pick", "good", "sse", "sfs"}});
  const ComparedPoint point = run.Summary().comparisons.at(0).points.at(0);
  EXPECT_EQ(point.real.n, 2);
  EXPECT_EQ(*point.real.value, 1.0);
  EXPECT_EQ(*point.other.value, 0.5);
}

}  // namespace
}  // namespace evac
