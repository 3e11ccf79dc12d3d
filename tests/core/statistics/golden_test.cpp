#include <gtest/gtest.h>

#include <filesystem>

#include "tests/core/statistics/golden_cases.h"
#include "tests/core/statistics/golden_functions.h"

namespace evac {
namespace {

const std::filesystem::path kGoldenFile = std::filesystem::path(EVAC_SHARED_DIR) / "data/stat_golden.json";

class GoldenStatistics : public testing::TestWithParam<std::string> {};

TEST_P(GoldenStatistics, GivesTheGoldenValuesOfEveryCase) {
  if (!std::filesystem::exists(kGoldenFile)) GTEST_SKIP() << kGoldenFile << " is not there";
  const std::vector<GoldenCase> cases = ReadGoldenCases(kGoldenFile, GetParam());
  EXPECT_FALSE(cases.empty());
  for (const GoldenCase& golden : cases) {
    const std::optional<std::string> difference = FirstDifference(golden);
    EXPECT_FALSE(difference) << golden.id << ": " << *difference;
  }
}

INSTANTIATE_TEST_SUITE_P(AllFunctions, GoldenStatistics, testing::ValuesIn(GoldenNames()),
                         [](const testing::TestParamInfo<std::string>& info) { return info.param; });

TEST(GoldenCases, ADifferenceIsFoundAndNamed) {
  GoldenCase golden{"some id", "mmrv", "ok", {{"sim", {0.5, 0.5, 0.5}}, {"real", {0.0, 0.3, 1.0}}}, {}, 1e-9};
  golden.expect = {{"per_policy", {0.0, 0.3, 0.9}}};
  EXPECT_EQ(FirstDifference(golden), "per_policy[2]: 1.0, wanted 0.9");
  golden.expect = {{"mmrv", nullptr}};
  EXPECT_TRUE(FirstDifference(golden).has_value());
  golden.expect = {{"what_nobody_computes", 1}};
  EXPECT_EQ(FirstDifference(golden), "what_nobody_computes: not answered, wanted 1");
  golden.status = "error";
  EXPECT_TRUE(FirstDifference(golden).has_value());
}

}  // namespace
}  // namespace evac
