#include "reports/report_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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

TEST(ReportJson, TheSameRunGivesTheSameBytes) {
  const SampleRun& run = LargeRun();
  EXPECT_EQ(ReportJson(run.Summary(), "evac test"), ReportJson(run.Summary(), "evac test"));
}

}  // namespace
}  // namespace evac
