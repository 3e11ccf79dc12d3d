#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <fstream>

#include "core/error.h"
#include "harness/policy_process.h"
#include "policies/lcm_policy.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// A harness's end and a policy's process, as a run has them.
class PolicyProgramsTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto wrong = WhatIsWrongWithLcm()) GTEST_SKIP() << *wrong;
  }

  PolicyProcessOptions Options(std::vector<std::string> command) const {
    PolicyProcessOptions options;
    options.command = std::move(command);
    options.environment = {{"EVAC_LCM_URL", address_.url}, {"EVAC_TOKEN", address_.token}, {"EVAC_CHUNK_SIZE", "16"}};
    options.log = folder_ / "policy.log";
    return options;
  }

  std::vector<Acted> Ask(LcmPolicy& policy) const {
    const SceneObservation asked{0, &observation_};
    return policy.Act({&asked, 1});
  }

  /// The process that wrote its number into the folder's `pid`.
  void Kill() const {
    pid_t pid = 0;
    std::ifstream(folder_ / "pid") >> pid;
    ASSERT_GT(pid, 0);
    ::kill(pid, SIGKILL);
  }

  const TempFolder folder_;
  const LcmAddress address_ =
      LcmAddress::For(fmt::format("{} {}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name()));
  const Task task_;
  const Observation observation_{.images = {}, .arms = Arms(1)};
};

TEST_F(PolicyProgramsTest, AnOptionOutranksTheEnvironment) {
  PolicyProcess process(Options({Binary("evac-policy"), "hold", "--chunk-size", "4", "--checkpoint", "short"}));
  LcmPolicy policy({.address = address_});
  EXPECT_EQ(policy.Handshake(HarnessSpec(task_, 4), 60).checkpoint, "short");
  try {
    policy.Handshake(HarnessSpec(task_, 16), 60);
    FAIL() << "4 targets were taken for 16";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("the policy sends fewer targets than the world executes at once"));
  }
}

TEST_F(PolicyProgramsTest, APolicyThatIsKilledFailsItsEpisodeAndIsThereForTheNext) {
  PolicyProcess process(Options(
      {"sh", "-c", fmt::format("echo $$ > '{0}/pid'; exec '{1}' hold", folder_.path().string(), Binary("evac-policy"))}));
  LcmPolicy policy({.address = address_, .deadline_s = 60});
  policy.Handshake(HarnessSpec(task_, 16), 60);
  policy.Reset(0, task_, 1);
  ASSERT_TRUE(std::holds_alternative<ActionChunk>(Ask(policy)[0]));

  ASSERT_NO_FATAL_FAILURE(Kill());
  const auto failed = Ask(policy);
  ASSERT_TRUE(std::holds_alternative<Failure>(failed[0]));
  EXPECT_EQ(std::get<Failure>(failed[0]).stop, StopReason::kPolicyError);
  EXPECT_THAT(std::get<Failure>(failed[0]).message, HasSubstr("restarted in the middle of the episode"));
  policy.Reset(0, task_, 1);
  EXPECT_TRUE(std::holds_alternative<ActionChunk>(Ask(policy)[0]));
  EXPECT_EQ(process.restarts(), 1);
}

/// It was ended at the deadline of what the one before it had been asked, and began to load once more.
TEST_F(PolicyProgramsTest, APolicyThatDiedAndIsLoadingAgainIsLeftToLoad) {
  PolicyProcessOptions process_options = Options(
      {"sh", "-c",
       fmt::format("cd '{}'; if test -e again; then sleep 8; fi; touch again; echo $$ > pid; exec '{}' hold",
                   folder_.path().string(), Binary("evac-policy"))});
  process_options.first_restart_after_s = 1;
  PolicyProcess process(process_options);
  LcmPolicyOptions options{.address = address_, .deadline_s = 4, .start_s = 60};
  options.restart = [&process](auto asked) { process.Restart(asked); };
  LcmPolicy policy(options);
  policy.Handshake(HarnessSpec(task_, 16), 60);
  policy.Reset(0, task_, 1);
  ASSERT_TRUE(std::holds_alternative<ActionChunk>(Ask(policy)[0]));

  ASSERT_NO_FATAL_FAILURE(Kill());
  const auto failed = Ask(policy);
  ASSERT_TRUE(std::holds_alternative<Failure>(failed[0]));
  EXPECT_EQ(std::get<Failure>(failed[0]).stop, StopReason::kPolicyTimeout);
  policy.Reset(0, task_, 1);
  EXPECT_TRUE(std::holds_alternative<ActionChunk>(Ask(policy)[0]));
  EXPECT_EQ(process.restarts(), 1);
}

TEST_F(PolicyProgramsTest, AWrongOptionIsToldInsteadOfWaitingForAnAnswer) {
  PolicyProcess process(Options({Binary("evac-policy"), "replay", "--recording", "/no/such/folder"}));
  LcmPolicyOptions options{.address = address_};
  options.why_gone = [&process] { return process.WhyGone(); };
  LcmPolicy policy(options);
  try {
    policy.Handshake(HarnessSpec(task_, 16), 3600);
    FAIL() << "there is nothing to replay";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("exit code 2: evac-policy: /no/such/folder: no such folder"));
  }
}

}  // namespace
}  // namespace evac
