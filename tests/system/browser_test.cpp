#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "tests/reports/stored_run.h"
#include "tests/support/command.h"

/// The report in a real browser: tests/system/browser/report_page.py says what is tried.
namespace evac::system_test {
namespace {

constexpr int kSkipped = 77;

TEST(Browser, ReadsTheReportFiltersItsClipsAndPlaysAFlipInStep) {
  const StoredRun run("flips", "sssfsffs", "ssfffsfs", 24);
  const CommandResult report = RunCommand({Binary("evac"), "report", run.folder().string()});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  std::vector<std::string> words = {"/usr/bin/python3", "-B", EVAC_SOURCE_DIR "/tests/system/browser/report_page.py",
                                    (run.folder() / "report" / "index.html").string()};
  if (const char* screenshots = std::getenv("EVAC_SCREENSHOTS")) words.push_back(screenshots);
  const CommandResult read = RunCommand(words);
  if (read.exit_code == kSkipped) GTEST_SKIP() << read.out;
  EXPECT_EQ(read.exit_code, 0) << read.err << read.out;
  EXPECT_THAT(read.out, testing::HasSubstr("0 failed")) << read.err;
}

TEST(Browser, TheReportIsValidHtml) {
  const StoredRun run("valid", "sf", "fs");
  ASSERT_EQ(RunCommand({Binary("evac"), "report", run.folder().string()}).exit_code, 0);
  if (!std::filesystem::exists("/usr/bin/tidy")) GTEST_SKIP() << "tidy is not installed";
  const CommandResult tidy = RunCommand({"/usr/bin/tidy", "-quiet", "-errors", "--drop-empty-elements", "no",
                                         (run.folder() / "report" / "index.html").string()});
  EXPECT_LT(tidy.exit_code, 2) << tidy.err;
  EXPECT_THAT(tidy.err, testing::Not(testing::HasSubstr("Error:")));
}

}  // namespace
}  // namespace evac::system_test
