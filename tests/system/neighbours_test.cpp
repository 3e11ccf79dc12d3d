#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/child.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::Mark;
using system_test::RunWords;
using system_test::WaitUntil;

TEST(Neighbours, TwoRunsAtOnceAndAStrayPolicyOfYesterdayDoNotHearEachOther) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "alone")).exit_code, 0);

  const Mark mark(folder.path().string());
  const Child stray({Binary("evac-policy"), "hold", "--chunk-size", "8"}, folder / "stray.log");
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
  EXPECT_EQ(mark.Processes(), std::vector<pid_t>{stray.pid()})
      << "the runs ended all that was theirs, and nothing else";
}

TEST(Neighbours, AStrayPolicyAtTheAddressThatASuiteJoinsIsRefusedByName) {
  const TempFolder folder;
  const Mark mark(folder.path().string());
  const std::string token = "t" + std::to_string(::getpid());
  const std::vector<std::string> hold = {Binary("evac-policy"), "hold", "--chunk-size", "8", "--token", token};
  const Child mine(hold, folder / "mine"), yesterdays(hold, folder / "yesterdays");
  const CommandResult result = RunCommand(RunWords(
      kFaults, folder / "run",
      {"policies.0={name: hold, join: {url: \"udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304\", token: " +
       token + "}}"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("2 policies answer on"));
}

/// Rates of one checkpoint were kept under the name of another, without a word.
TEST(Neighbours, APolicyThatIsJoinedUnderAnotherNameThanItsOwnIsNotedOnceAndNotRefused) {
  const TempFolder folder;
  const std::string token = "n" + std::to_string(::getpid());
  const Child there({Binary("evac-policy"), "hold", "--chunk-size", "8", "--checkpoint", "b", "--token", token},
                    folder / "there");
  const CommandResult result = RunCommand(RunWords(
      kFaults, folder / "run",
      {"policies.0={name: mine, checkpoint: a, join: {url: \"udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304\", "
       "token: " + token + "}}",
       "initial_states.count=1", "transport.start_s=60"}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const std::string note = "evac: note: policy mine@a declares itself as hold@b;";
  ASSERT_THAT(result.err, testing::HasSubstr(note));
  EXPECT_EQ(result.err.find(note), result.err.rfind(note));
}

}  // namespace
}  // namespace evac
