#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::KillAll;
using system_test::List;
using system_test::Mark;
using system_test::RunWords;
using system_test::WaitUntil;

TEST(Neighbours, TwoRunsAtOnceAndAStrayPolicyOfYesterdayDoNotHearEachOther) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "alone")).exit_code, 0);

  const Mark mark(folder.path().string());
  const pid_t stray = StartCommand({Binary("evac-policy"), "hold", "--chunk-size", "8"}, folder / "stray.log");
  const pid_t one = StartCommand(RunWords(kFaults, folder / "one"), folder / "one.log");
  const pid_t other = StartCommand(RunWords(kFaults, folder / "other"), folder / "other.log");
  for (const pid_t run : {one, other}) {
    int status = 0;
    ::waitpid(run, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(List(folder / "one"), List(folder / "alone"));
  EXPECT_EQ(List(folder / "other"), List(folder / "alone"));
  for (const char* log : {"one.log", "other.log"})
    EXPECT_THAT(ReadFile(folder / log), testing::Not(testing::HasSubstr("foreign_replies"))) << "it heard the other";
  EXPECT_EQ(mark.Processes(), std::vector<pid_t>{stray}) << "the runs ended all that was theirs, and nothing else";
  KillAll({stray});
  ::waitpid(stray, nullptr, 0);
}

TEST(Neighbours, AStrayPolicyAtTheAddressThatASuiteJoinsIsRefusedByName) {
  const TempFolder folder;
  const Mark mark(folder.path().string());
  const std::string token = "t" + std::to_string(::getpid());
  std::vector<pid_t> policies;
  for (const char* log : {"mine", "yesterdays"})
    policies.push_back(
        StartCommand({Binary("evac-policy"), "hold", "--chunk-size", "8", "--token", token}, folder / log));
  const CommandResult result = RunCommand(RunWords(
      kFaults, folder / "run",
      {"policies.0={name: hold, join: {url: \"udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304\", token: " +
       token + "}}"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("2 policies answer on"));
  KillAll(policies);
  for (const pid_t policy : policies) ::waitpid(policy, nullptr, 0);
}

}  // namespace
}  // namespace evac
