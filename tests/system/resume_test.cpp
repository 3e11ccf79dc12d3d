#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/file.h"
#include "core/hash.h"
#include "core/seed.h"
#include "core/store.h"
#include "harness/suite.h"
#include "tests/support/child.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "tests/system/killed_run.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

using system_test::kFaults;
using system_test::KillAll;
using system_test::KillOnce;
using system_test::List;
using system_test::MadeAnew;
using system_test::Mark;
using system_test::RunWords;
using system_test::Stored;
using system_test::VideoTimes;
using system_test::WaitUntil;
using testing::HasSubstr;

const std::string& kSuite = system_test::kSmall;

std::string Lanes(int lanes) { return "lanes=" + std::to_string(lanes); }

/// Every file of a run but the store itself and what policies print: name → content.
std::map<std::string, std::string> Videos(const fs::path& run) {
  std::map<std::string, std::string> videos;
  for (const auto& entry : fs::recursive_directory_iterator(run / "videos")) {
    if (entry.is_regular_file()) videos[fs::relative(entry.path(), run).string()] = Sha256HexOfFile(entry.path());
  }
  return videos;
}

int Kills() { return std::getenv("EVAC_LONG") ? 20 : 5; }

TEST(Resume, AfterAnyKillTheTablesAndVideosAreThoseOfAnUninterruptedRun) {
  const TempFolder folder;
  const fs::path whole = folder / "whole", killed = folder / "killed";
  const auto begin = Clock::now();
  const CommandResult straight = RunCommand(RunWords(kSuite, whole, {Lanes(3)}));
  ASSERT_EQ(straight.exit_code, 0) << straight.err;
  const double whole_s = std::chrono::duration<double>(Clock::now() - begin).count();

  // The first one in the midst of it, the others wherever they come.
  KillOnce([&] { return Stored(killed) > 0; }, RunWords(kSuite, killed, {Lanes(2)}), folder / "log");
  const auto finished = VideoTimes(killed);
  EXPECT_THAT(finished.size(), testing::AllOf(testing::Gt(0u), testing::Lt(Stored(whole))));
  SplitMix64 random(20);
  for (int kill = 1; kill < Kills(); ++kill) {
    const pid_t pid = StartCommand(RunWords(kSuite, killed, {Lanes(kill % 2 ? 3 : 2)}), folder / "log");
    std::this_thread::sleep_for(std::chrono::duration<double>(random.Uniform(0, 1.5 * whole_s / Kills())));
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
  }
  const CommandResult last = RunCommand(RunWords(kSuite, killed, {Lanes(4)}));
  ASSERT_EQ(last.exit_code, 0) << last.err;

  EXPECT_EQ(List(killed), List(whole));
  EXPECT_EQ(Videos(killed), Videos(whole));
  EXPECT_THAT(MadeAnew(finished, killed), testing::IsEmpty()) << "what was stored is kept";
  for (const auto& episode : nlohmann::json::parse(List(killed))) {
    EXPECT_EQ(Sha256HexOfFile(killed / episode["video"].get<std::string>()), episode["video_sha256"]);
  }
}

/// A run of the small suite of one world whose policy, or it and its policy, is killed at random moments and which is
/// continued each time; in the end the failed episodes run again.
std::string ListAfterKilling(const fs::path& run, bool harness_too, int kills) {
  const Mark mark(run.string());
  const std::vector<std::string> words = RunWords(kFaults, run, {"initial_states.count=4", Lanes(2)});
  SplitMix64 random(harness_too ? 21 : 22);
  for (int kill = 0; kill < kills;) {
    const pid_t pid = StartCommand(words, run.string() + ".log");
    bool has_ended = false;
    for (int in_this_run = 0; in_this_run < 3 && !has_ended && kill < kills; ++in_this_run, ++kill) {
      WaitUntil([&] { return !mark.Processes("faulty-policy").empty() || ::waitpid(pid, nullptr, WNOHANG) == pid; });
      std::this_thread::sleep_for(std::chrono::duration<double>(random.Uniform(0, 0.6)));
      if (harness_too) ::kill(pid, SIGKILL);
      KillAll(mark.Processes("faulty-policy"));
      has_ended = harness_too;
    }
    ::waitpid(pid, nullptr, 0);
    EXPECT_TRUE(WaitUntil([&] { return mark.Processes().empty(); })) << "something outlived the run";
  }
  RunCommand(words);
  const CommandResult retried = RunCommand({Binary("evac"), "resume", run.string(), "--retry-failed"});
  EXPECT_EQ(retried.exit_code, 0) << retried.err;
  return List(run);
}

TEST(Resume, AfterThePolicyOrBothWereKilledTheTablesAndVideosAreThoseOfAnUninterruptedRun) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "whole", {"initial_states.count=4"})).exit_code, 0);
  const int kills = std::getenv("EVAC_LONG") ? 20 : 3;
  for (const char* killed : {"policy", "both"}) {
    EXPECT_EQ(ListAfterKilling(folder / killed, killed == std::string("both"), kills), List(folder / "whole"))
        << killed;
    EXPECT_EQ(Videos(folder / killed), Videos(folder / "whole")) << killed;
  }
}

/// How many verdicts there are; none before the first episode's files are there.
std::size_t Judged(const fs::path& run) try {
  return Stored(run) == 0 ? 0 : Store::Open(run, Store::Mode::kReadOnly).CurrentVerdicts().size();
} catch (const Error&) {
  return 0;
}

/// A run was judged at its end alone: whoever looked before found no verdict, and `evac judge` was refused beside it.
TEST(Resume, ARunInProgressHasVerdictsOfThePoliciesThatAreThrough) {
  const TempFolder folder;
  const fs::path run = folder / "run";
  Child child(RunWords(kSuite, run), folder / "log");
  EXPECT_TRUE(WaitUntil([&] { return Judged(run) > 0; }, 600)) << ReadFile(folder / "log");
  EXPECT_LT(Stored(run), 16u) << "it is not over";
  const int status = child.End(SIGINT);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 4) << status;
  EXPECT_THAT(Judged(run), testing::AllOf(testing::Gt(0u), testing::Lt(16u)));

  const CommandResult resumed = RunCommand({Binary("evac"), "resume", run.string()});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(Judged(run), 16u);
}

TEST(Resume, WhoRanWithOtherTimesThanTheRunBeganWithIsToldTheCommandThatKeepsThem) {
  const TempFolder folder;
  std::ofstream(folder / "sick") << "yes";
  const std::string run = (folder / "run").string();
  std::vector<std::string> assignments = {
      "policies.0.command=[faulty-policy, --fault, error, --while, " + (folder / "sick").string() + "]", "error_budget=0"};
  const CommandResult began = RunCommand(RunWords(kFaults, run, assignments));
  EXPECT_EQ(began.exit_code, 4);
  EXPECT_THAT(began.err, HasSubstr("go on with: evac resume " + run + " --retry-failed"));

  assignments.push_back("transport.deadline_s=60");
  std::vector<std::string> words = RunWords(kFaults, run, assignments);
  const CommandResult longer = RunCommand(words);
  EXPECT_EQ(longer.exit_code, 4);
  EXPECT_THAT(longer.err, HasSubstr("go on with: evac run " + kFaults + " --out " + run + " --set 'policies.0.command=["));
  EXPECT_THAT(longer.err, HasSubstr("--set error_budget=0 --set transport.deadline_s=60 --retry-failed\n"));
  EXPECT_THAT(longer.err, testing::Not(HasSubstr("the last: \n"))) << "the budget was spent before";

  std::filesystem::remove(folder / "sick");
  words.push_back("--retry-failed");
  const CommandResult good = RunCommand(words);
  EXPECT_EQ(good.exit_code, 0) << good.err;
}

/// `evac resume` was named, which looked where the suite had lain.
TEST(Resume, WhoGoesOnWithASuiteThatWasMovedIsToldACommandThatFindsIt) {
  const TempFolder folder;
  const std::string run = (folder / "run").string(), sick = (folder / "sick").string();
  std::ofstream(sick) << "yes";
  std::string text = ReadFile(kFaults);
  const auto put = [&](const std::string& found, const std::string& wanted) {
    text.replace(text.find(found), found.size(), wanted);
  };
  put("../../worldmodel/sim/profiles/real.yaml", "real.yaml");
  put("../../worldmodel", EVAC_SOURCE_DIR "/worldmodel");
  for (const char* place : {"old", "new"}) {
    fs::create_directory(folder / place);
    std::ofstream(folder / place / "suite.yaml") << text;
    fs::copy_file(EVAC_SOURCE_DIR "/worldmodel/sim/profiles/real.yaml", folder / place / "real.yaml");
  }
  const std::vector<std::string> assignments = {
      "policies.0.command=[faulty-policy, --fault, error, --while, " + sick + "]", "error_budget=0"};
  const CommandResult began = RunCommand(RunWords((folder / "old/suite.yaml").string(), run, assignments));
  EXPECT_THAT(began.err, HasSubstr("go on with: evac resume " + run + " --retry-failed"));
  fs::remove_all(folder / "old");
  std::vector<std::string> words = RunWords((folder / "new/suite.yaml").string(), run, assignments);
  const CommandResult moved = RunCommand(words);
  EXPECT_EQ(moved.exit_code, 4) << moved.err;
  EXPECT_THAT(moved.err, HasSubstr("go on with: evac run " + words.at(2) + " --out " + run + " --set "));
  fs::remove(sick);
  words.push_back("--retry-failed");
  EXPECT_EQ(RunCommand(words).exit_code, 0);
}

TEST(Resume, FailedEpisodesKeepTheirReasonsWhereTheirPolicyCannotBeStartedAgain) {
  const TempFolder folder;
  const fs::path script = folder / "policy.sh";
  std::ofstream(script) << "exec '" << Binary("faulty-policy") << "' --fault error\n";
  const std::string run = (folder / "run").string();
  const CommandResult ended =
      RunCommand(RunWords(kFaults, run, {"policies.0.command=[/bin/sh, " + script.string() + "]", "error_budget=0"}));
  EXPECT_EQ(ended.exit_code, 4) << ended.err;
  const std::string before = List(run);
  EXPECT_THAT(before, HasSubstr("policy_error"));

  fs::remove(script);
  const CommandResult retried = RunCommand({Binary("evac"), "resume", run, "--retry-failed"});
  EXPECT_EQ(retried.exit_code, 2) << retried.err;
  EXPECT_EQ(List(run), before);
}

TEST(Resume, TheCommandThatGoesOnIsReadBackByAShell) {
  const TempFolder folder;
  const std::string run = (folder / "my run").string();
  const CommandResult ended = RunCommand(
      RunWords(kFaults, run, {"policies.0.command=[faulty-policy, --fault, error]", "error_budget=0"}));
  EXPECT_EQ(ended.exit_code, 4);
  EXPECT_THAT(ended.err, HasSubstr("go on with: evac resume '" + run + "' --retry-failed\n"));
  const CommandResult again = RunCommand({Binary("evac"), "resume", run});
  EXPECT_EQ(again.exit_code, 4);
  EXPECT_THAT(again.err, HasSubstr("go on with: evac resume '" + run + "' --retry-failed\n"));
}

TEST(Resume, ARunThatAnotherVersionBeganGoesOnAndSaysSo) {
  const TempFolder folder;
  const Suite suite = ReadSuite(kFaults, {"initial_states.count=1"});
  Store::CreateOrContinue(folder / "run", {.suite_text = suite.text, .suite_hash = suite.hash, .suite_path = kFaults, .evac_version = "0.0.1"});
  const CommandResult goes_on = RunCommand({Binary("evac"), "resume", (folder / "run").string()});
  EXPECT_EQ(goes_on.exit_code, 0) << goes_on.err;
  EXPECT_THAT(goes_on.err, HasSubstr("was begun by evac 0.0.1; evac "));
}

TEST(Resume, ASuiteThatIsMendedBeforeItsFirstEpisodeRunsInTheSameFolder) {
  const TempFolder folder;
  const fs::path run = folder / "run";
  const CommandResult refused =
      RunCommand(RunWords(kFaults, run, {"initial_states.count=1", "policies.0.command=[/no/such/policy]"}));
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  const CommandResult mended = RunCommand(RunWords(kFaults, run, {"initial_states.count=1"}));
  EXPECT_EQ(mended.exit_code, 0) << mended.err;
}

TEST(Resume, ARunIsNotContinuedWithAnotherSuite) {
  const TempFolder folder;
  const fs::path run = folder / "run";
  ASSERT_EQ(RunCommand(RunWords(kFaults, run, {"initial_states.count=1"})).exit_code, 0);
  const CommandResult other = RunCommand(RunWords(kFaults, run, {"initial_states.count=1", "seeds=[5]"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("suite"), std::string::npos) << other.err;
}

}  // namespace
}  // namespace evac
