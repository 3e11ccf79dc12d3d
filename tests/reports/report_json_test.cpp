#include "reports/report_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "reports/headlines.h"
#include "reports/methods.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

nlohmann::json Parsed(const RunSummary& summary) { return nlohmann::json::parse(ReportJson(summary, "evac test")); }

/// Every estimate below `json`: it has a value and an interval, each a number or null with a reason, and n and a
/// method.
void ExpectHonest(const nlohmann::json& json, int& estimates) {
  if (json.is_object() && json.contains("interval")) {
    ++estimates;
    EXPECT_TRUE(json["value"].is_number() || !json.value("value_reason", "").empty()) << json;
    EXPECT_TRUE(json["interval"].is_array() || !json.value("interval_reason", "").empty()) << json;
    EXPECT_TRUE(json["n"].is_number_integer()) << json;
    EXPECT_TRUE(json["method"].is_string() && !json["method"].get<std::string>().empty()) << json;
  }
  for (const auto& child : json) {
    if (child.is_structured()) ExpectHonest(child, estimates);
  }
}

TEST(ReportJson, EveryNumberHasItsIntervalItsNAndItsMethod) {
  for (const RunSummary& summary : {LargeRun().Summary(), SampleRun({{"a", "pick", "1", "ue", "sf"}}).Summary()}) {
    int estimates = 0;
    ExpectHonest(Parsed(summary), estimates);
    EXPECT_GT(estimates, 4);
  }
}

TEST(ReportJson, UndefinedIsNullWithAReasonAndNeverZero) {
  const nlohmann::json json = Parsed(SampleRun({{"a", "pick", "1", "uu", "sf"}}).Summary());
  EXPECT_TRUE(json["rates"][0]["success_rate"]["value"].is_null());
  EXPECT_TRUE(json["comparisons"][0]["correlation"]["pearson"]["value"].is_null());
  EXPECT_TRUE(json["comparisons"][0]["pairs"][0]["mcnemar_p_exact"].is_null());
  EXPECT_EQ(json["comparisons"][0]["pairs"][0]["mcnemar_p_exact_reason"], "no pairs");
}

TEST(ReportJson, HoldsTheSchemaTheFlipsAndWhereTheNumbersComeFrom) {
  const nlohmann::json json = Parsed(SampleRun({{"a", "pick", "1", "sfs", "fss"}}).Summary());
  EXPECT_EQ(json["schema"], kReportJsonSchema);
  EXPECT_EQ(json["comparisons"][0]["pairs"][0]["flips"].size(), 2u);
  EXPECT_EQ(json["comparisons"][0]["pairs"][0]["flips"][0]["real"], "success");
  EXPECT_EQ(json["provenance"]["suite_hash"], "suite-hash");
  EXPECT_EQ(json["episodes"].size(), 6u);
}

/// Two checkpoints, of which a classifier calls all a success; of two raters one takes one state for a failure.
ReportData OfManyJudges() {
  SampleRun run({{"a", "pick", "s1", "ssff", "ssff"}, {"a", "pick", "s2", "ssss", "ssss"}});
  std::vector<Verdict> verdicts;
  for (const Episode& episode : run.store().Episodes()) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.label = Label::kSuccess;
    verdict.judge = "human:study:r1";
    verdicts.push_back(verdict);
    verdict.judge = "classifier:abc";
    verdict.probability = 0.9;
    verdicts.push_back(verdict);
    verdict.judge = "human:study:r2";
    verdict.probability.reset();
    if (episode.key.pair.initial_state == "41-0003") verdict.label = Label::kFailure;
    verdicts.push_back(verdict);
  }
  run.store().AddVerdicts(verdicts);
  return ReportDataOf(run.Summary());
}

/// It had findings, rates, comparisons and gates alone, and was said to hold everything that the page says.
TEST(ReportJson, HoldsEveryPartOfThePage) {
  const ReportData report = OfManyJudges();
  const auto json = nlohmann::json::parse(ReportJson(report, "evac test"));
  int estimates = 0;
  ExpectHonest(json, estimates);
  EXPECT_GT(estimates, 20);
  ASSERT_EQ(json["in_short"].size(), 4u);
  const Headline first = HeadlinesOf(report).front();
  EXPECT_EQ(json["in_short"][0]["question"], first.question);
  EXPECT_EQ(json["in_short"][0]["answers"][0]["text"], first.items.at(0).text);
  ASSERT_EQ(json["candidates"].size(), 1u);
  const nlohmann::json& candidate = json["candidates"][0];
  EXPECT_EQ(candidate["policy"], "pick@s2");
  EXPECT_EQ(candidate["baseline"], "pick@s1");
  EXPECT_EQ(candidate["all_tasks"]["p_holm"], *report.candidates.at(0).p_holm);
  EXPECT_EQ(candidate["tasks"][0]["p_holm"], *report.candidates.at(0).task_p_holm.at(0));
  EXPECT_FALSE(candidate["tasks"][0].contains("winner")) << "by another family than the page's";
  EXPECT_EQ(json["trust"]["worlds"][0]["tasks"][0]["trust"], Name(report.trust.at(0).tasks.at(0).trust));
  EXPECT_EQ(json["stages"]["funnels"].size(), report.stages.funnels.size());
  EXPECT_EQ(json["stages"]["partings"][0]["pairs"], report.stages.partings.at(0).pairs);
  EXPECT_EQ(json["checkpoints"][0]["points"][1]["checkpoint"], "s2");
  EXPECT_EQ(json["checkpoints"][0]["points"][1]["rates"][0]["value"], 1);
  EXPECT_EQ(json["methods"], MethodsParagraph(report));
}

TEST(ReportJson, SaysHowFarEachJudgeMayBeBelieved) {
  const ReportData report = OfManyJudges();
  const auto json = nlohmann::json::parse(ReportJson(report, "evac test"));
  const nlohmann::json& judges = json["judges"];
  ASSERT_EQ(judges["agreement"].size(), report.judges.judges.size());
  const nlohmann::json& classifier = judges["agreement"][0];
  EXPECT_EQ(classifier["judge"], "classifier:abc");
  EXPECT_EQ(classifier["against"], "oracle");
  EXPECT_EQ(classifier["world"], "real");
  EXPECT_EQ(classifier["compared"], 8);
  EXPECT_EQ(classifier["only_judge_success"], 2);
  EXPECT_EQ(classifier["kinder_by"]["value"], 0.25);
  EXPECT_TRUE(classifier.contains("brier")) << "it gives probabilities";
  EXPECT_FALSE(judges["agreement"].back().contains("brier")) << "a rater gives none";
  EXPECT_EQ(judges["raters"].size(), 2u);
  EXPECT_EQ(judges["raters_alpha"], *report.judges.alpha);
  ASSERT_EQ(judges["rates_by_other_judges"].size(), 1u);
  EXPECT_EQ(judges["rates_by_other_judges"][0]["rates"][0]["success_rate"]["value"], 1);
}

TEST(ReportJson, TheSameRunGivesTheSameBytes) {
  const SampleRun& run = LargeRun();
  EXPECT_EQ(ReportJson(run.Summary(), "evac test"), ReportJson(run.Summary(), "evac test"));
}

}  // namespace
}  // namespace evac
