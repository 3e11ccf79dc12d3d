#include "harness/policy_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "core/error.h"
#include "core/file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using testing::HasSubstr;

/// Looks again and again until it holds; the bound only ends a test that has failed.
template <typename Condition>
bool Eventually(const Condition& holds) {
  for (int look = 0; look < 3000; ++look) {
    if (holds()) return true;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return false;
}

/// Whether the process runs: one that ended and waits to be buried does not.
bool IsAlive(pid_t process) {
  std::ifstream file(fs::path("/proc") / std::to_string(process) / "stat");
  std::string text;
  if (!std::getline(file, text)) return false;
  return text.at(text.rfind(')') + 2) != 'Z';
}

class PolicyProcessTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "evac-process-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  void TearDown() override { fs::remove_all(folder_); }

  PolicyProcessOptions Shell(const std::string& script) const {
    PolicyProcessOptions options;
    options.command = {"sh", "-c", script};
    options.environment = {{"FOLDER", folder_.string()}};
    options.log = folder_ / "policy.log";
    options.first_restart_after_s = 0.01;
    return options;
  }

  std::string Log() const { return ReadFile(folder_ / "policy.log"); }

  /// The process id that the script wrote into a file, once it is there whole.
  pid_t PidIn(const std::string& file) const {
    pid_t pid = 0;
    EXPECT_TRUE(Eventually([&] { return (std::ifstream(folder_ / file) >> pid) && pid > 0; })) << file;
    return pid;
  }

  fs::path folder_;
};

constexpr const char* kWritePids =
    "sleep 1000 & echo $! > $FOLDER/child; setsid sleep 1001 & echo $! > $FOLDER/runaway; echo $$ > $FOLDER/self; wait";

TEST_F(PolicyProcessTest, ItsOutputAndEnvironmentAreItsOwn) {
  PolicyProcessOptions options = Shell(
      "echo out $EVAC_TOKEN; echo err >&2; pwd; cut -d ' ' -f 6 /proc/$$/stat > $FOLDER/session; echo $$ > "
      "$FOLDER/self; sleep 1000");
  options.environment["EVAC_TOKEN"] = "word";
  options.working_directory = folder_;
  std::ofstream(options.log) << "before\n";
  PolicyProcess process(options);
  const pid_t self = PidIn("self");
  EXPECT_EQ(PidIn("session"), self);
  EXPECT_EQ(Log(), "before\nout word\nerr\n" + fs::canonical(folder_).string() + "\n");
}

TEST_F(PolicyProcessTest, OneThatDiesIsStartedAgain) {
  PolicyProcess process(
      Shell("test -e $FOLDER/second && echo $$ > $FOLDER/self && exec sleep 1000; touch $FOLDER/second; exit 7"));
  EXPECT_TRUE(IsAlive(PidIn("self")));
  EXPECT_EQ(process.restarts(), 1);
  EXPECT_EQ(process.WhyGone(), std::nullopt);
}

TEST_F(PolicyProcessTest, OneThatHangsIsRestartedOnDemand) {
  PolicyProcess process(Shell("trap '' TERM; echo $$ > $FOLDER/self; while :; do sleep 1000; done"));
  const pid_t first = PidIn("self");
  fs::remove(folder_ / "self");
  process.Restart(std::chrono::steady_clock::now());
  const pid_t second = PidIn("self");
  EXPECT_NE(second, first);
  EXPECT_FALSE(IsAlive(first));
  EXPECT_EQ(process.restarts(), 1);
  EXPECT_FALSE(process.WhyGone());
}

/// One that had died, and was loading again, was ended for what its predecessor did not answer.
TEST_F(PolicyProcessTest, OneThatWasStartedSinceItWasAskedIsNotTakenToHang) {
  const auto asked = std::chrono::steady_clock::now();
  PolicyProcess process(Shell("echo $$ > $FOLDER/self; exec sleep 1000"));
  const pid_t self = PidIn("self");
  process.Restart(asked);
  for (int look = 0; look < 100 && IsAlive(self); ++look) std::this_thread::sleep_for(milliseconds(10));
  EXPECT_TRUE(IsAlive(self));
  EXPECT_EQ(process.restarts(), 0);
}

TEST_F(PolicyProcessTest, OneThatDiesAgainAndAgainIsGivenUpWithItsLastWords) {
  PolicyProcessOptions options = Shell("echo first words; echo no such checkpoint; exit 3");
  options.restarts = 2;
  PolicyProcess process(options);
  ASSERT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
  EXPECT_EQ(*process.WhyGone(),
            "its process ended 3 times within 60 s, at last with exit code 3: no such checkpoint (" +
                options.log.string() + ")");
  EXPECT_EQ(process.restarts(), 2);
}

TEST_F(PolicyProcessTest, WhatAnEarlierProcessSaidIsNotTakenForItsLastWords) {
  PolicyProcessOptions silent = Shell("exit 3");
  silent.restarts = 0;
  std::ofstream(silent.log) << "yesterday: out of memory\n";
  PolicyProcess process(silent);
  ASSERT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
  EXPECT_THAT(*process.WhyGone(), HasSubstr("at last with exit code 3: it said nothing ("));

  PolicyProcessOptions second_says_nothing = Shell("test -e $FOLDER/second && exit 4; touch $FOLDER/second; echo first; exit 3");
  second_says_nothing.restarts = 1;
  PolicyProcess other(second_says_nothing);
  ASSERT_TRUE(Eventually([&] { return other.WhyGone().has_value(); }));
  EXPECT_THAT(*other.WhyGone(), HasSubstr("at last with exit code 4: it said nothing ("));
}

TEST_F(PolicyProcessTest, OneThatIsKilledIsSaidToBe) {
  PolicyProcessOptions options = Shell("kill -SEGV $$");
  options.restarts = 0;
  PolicyProcess process(options);
  ASSERT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
  EXPECT_THAT(*process.WhyGone(), HasSubstr("signal 11 (Segmentation fault)"));
}

/// "At last with signal 9 (Killed)": who looked for a kernel that was out of memory looked in vain.
TEST_F(PolicyProcessTest, OneThatWasEndedForItsSilenceIsSaidToBe) {
  PolicyProcessOptions options = Shell("echo loads; echo $$ > $FOLDER/self; exec sleep 1000");
  options.restarts = 0;
  PolicyProcess process(options);
  PidIn("self");
  ASSERT_TRUE(Eventually([&] {
    process.Restart(std::chrono::steady_clock::now());
    return process.WhyGone().has_value();
  }));
  EXPECT_EQ(*process.WhyGone(), "its process ended once within 60 s, at last by evac because it was silent: loads (" +
                                    options.log.string() + ")");
}

TEST_F(PolicyProcessTest, OneThatLeavesWithCodeTwoWhenItIsEndedForItsSilenceIsStartedAgain) {
  PolicyProcess process(Shell("trap 'exit 2' TERM; echo $$ > $FOLDER/self; while :; do sleep 0.01; done"));
  const pid_t first = PidIn("self");
  fs::remove(folder_ / "self");
  process.Restart(std::chrono::steady_clock::now());
  EXPECT_NE(PidIn("self"), first);
  EXPECT_EQ(process.WhyGone(), std::nullopt);
}

TEST_F(PolicyProcessTest, ACommandThatDoesNotExistIsNotTriedAgain) {
  PolicyProcessOptions options = Shell("");
  options.command = {"no-such-policy", "--now"};
  PolicyProcess process(options);
  ASSERT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
  EXPECT_THAT(*process.WhyGone(), HasSubstr("cannot start no-such-policy: No such file or directory"));
  EXPECT_EQ(process.restarts(), 0);
}

TEST_F(PolicyProcessTest, AnEmptyCommandOrALogThatCannotBeWrittenIsRefused) {
  PolicyProcessOptions options = Shell("true");
  options.log = folder_ / "no" / "such" / "folder.log";
  EXPECT_THROW(PolicyProcess{options}, Error);
  options.command.clear();
  EXPECT_THROW(PolicyProcess{options}, Error);
}

TEST_F(PolicyProcessTest, StopLetsItLeaveInPeace) {
  PolicyProcess process(
      Shell("trap 'echo goodbye; exit 0' TERM; echo $$ > $FOLDER/self; while :; do sleep 0.01; done"));
  const pid_t self = PidIn("self");
  process.Stop();
  EXPECT_FALSE(IsAlive(self));
  EXPECT_THAT(Log(), HasSubstr("goodbye\n"));
  EXPECT_EQ(process.WhyGone(), std::nullopt);
  process.Stop();  // again: nothing happens
}

TEST_F(PolicyProcessTest, StopEndsOneThatIgnoresItsRequest) {
  PolicyProcessOptions options = Shell("trap '' TERM; echo $$ > $FOLDER/self; while :; do sleep 0.01; done");
  options.grace_s = 0.1;
  PolicyProcess process(options);
  const pid_t self = PidIn("self");
  process.Stop();
  EXPECT_FALSE(IsAlive(self));
}

TEST_F(PolicyProcessTest, StopEndsWhatItStartedToo) {
  PolicyProcess process(Shell(kWritePids));
  const pid_t child = PidIn("child"), runaway = PidIn("runaway"), self = PidIn("self");
  process.Stop();
  EXPECT_FALSE(IsAlive(self));
  EXPECT_FALSE(IsAlive(child));
  EXPECT_FALSE(IsAlive(runaway));
}

TEST_F(PolicyProcessTest, WhatItStartedEndsWithIt) {
  const std::string until_it_ran_away =
      "read away < $FOLDER/runaway; until test \"$(cut -d ' ' -f 6 /proc/$away/stat)\" = $away; do sleep 0.01; done";
  PolicyProcessOptions options = Shell(std::string(kWritePids) + " & " + until_it_ran_away + "; exit 5");
  options.restarts = 0;
  PolicyProcess process(options);
  const pid_t child = PidIn("child"), runaway = PidIn("runaway");
  ASSERT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
  EXPECT_FALSE(IsAlive(child));
  EXPECT_FALSE(IsAlive(runaway));
}

TEST_F(PolicyProcessTest, NothingOutlivesAHarnessThatIsKilled) {
  const pid_t harness = ::fork();
  if (harness == 0) {
    PolicyProcess one(Shell(kWritePids));
    PolicyProcess other(Shell("echo $$ > $FOLDER/other; exec sleep 1002"));  // may not hold the first one's pipe open
    for (;;) ::pause();
  }
  const pid_t processes[] = {PidIn("self"), PidIn("child"), PidIn("runaway"), PidIn("other")};
  for (const pid_t process : processes) EXPECT_TRUE(IsAlive(process));
  ::kill(harness, SIGKILL);
  ::waitpid(harness, nullptr, 0);
  for (const pid_t process : processes) EXPECT_TRUE(Eventually([&] { return !IsAlive(process); }));
}

TEST_F(PolicyProcessTest, ThePolicyEndsEvenIfItsGuardianIsKilled) {
  PolicyProcessOptions options = Shell("echo $PPID > $FOLDER/guardian; echo $$ > $FOLDER/self; exec sleep 1000");
  options.restarts = 0;
  PolicyProcess process(options);
  const pid_t guardian = PidIn("guardian"), self = PidIn("self");
  ::kill(guardian, SIGKILL);
  EXPECT_TRUE(Eventually([&] { return !IsAlive(self); }));
  EXPECT_TRUE(Eventually([&] { return process.WhyGone().has_value(); }));
}

}  // namespace
}  // namespace evac
