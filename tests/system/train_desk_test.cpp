#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <thread>

#include "core/file.h"
#include "core/hash.h"
#include "core/seed.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

std::vector<std::string> Words(const fs::path& out) {
  return {EVAC_SOURCE_DIR "/apps/train_desk.sh", Binary("evac"), out.string(), "world",
          EVAC_SOURCE_DIR "/tests/system/small_desk"};
}

/// What a training of the desk leaves for others: file → SHA-256.
std::map<std::string, std::string> Made(const fs::path& out) {
  std::map<std::string, std::string> made;
  for (const char* file : {"shards/statistics.yaml", "codec/codec.safetensors", "judge/judge.safetensors",
                           "policy/policy.safetensors", "world/weights.safetensors"})
    made[file] = fs::exists(out / file) ? Sha256HexOfFile(out / file) : "missing";
  return made;
}

TEST(TrainDesk, KilledAtTenRandomMomentsItEndsInTheSameWeights) {
  if (!std::getenv("EVAC_LONG")) GTEST_SKIP() << "takes minutes: ./run test long";
  const TempFolder folder;
  const fs::path whole = folder / "whole", killed = folder / "killed";
  const auto begin = Clock::now();
  const CommandResult straight = RunCommand(Words(whole));
  ASSERT_EQ(straight.exit_code, 0) << straight.err;
  const double whole_s = std::chrono::duration<double>(Clock::now() - begin).count();

  constexpr int kKills = 10;
  SplitMix64 random(30);
  int died = 0;
  for (int kill = 0; kill < kKills; ++kill) {
    const system_test::Mark mark(killed.string());
    const pid_t pid = StartCommand(Words(killed), folder / "log");
    std::this_thread::sleep_for(std::chrono::duration<double>(random.Uniform(0.5, 1.5 * whole_s / kKills)));
    system_test::KillAll(mark.Processes());
    int status = 0;
    ::waitpid(pid, &status, 0);
    died += WIFSIGNALED(status) ? 1 : 0;
    EXPECT_TRUE(system_test::WaitUntil([&] { return mark.Processes().empty(); })) << "something outlived the kill";
  }
  EXPECT_GE(died, kKills / 2) << "it had ended before it was killed";
  const CommandResult last = RunCommand(Words(killed));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(Made(killed), Made(whole));
}

TEST(TrainDesk, AStepThatIsNoneIsRefused) {
  const TempFolder folder;
  const CommandResult result =
      RunCommand({EVAC_SOURCE_DIR "/apps/train_desk.sh", Binary("evac"), (folder / "out").string(), "wold"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("the last step is 'wold', wanted collect"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(folder / "out"));
}

/// The script with a program in evac's place that says its words and ends as told.
CommandResult WithEndings(const fs::path& folder, const std::string& endings) {
  const fs::path program = folder / "program";
  WriteFileAtomically(program, "#!/bin/sh\necho \"$1 $2\"\ncase \"$1 $2\" in\n" + endings + "esac\n");
  fs::permissions(program, fs::perms::owner_exec, fs::perm_options::add);
  return RunCommand({EVAC_SOURCE_DIR "/apps/train_desk.sh", program.string(), (folder / "out").string()});
}

TEST(TrainDesk, TooFewPairsToBalanceTheJudgeByAreNoFailure) {
  const TempFolder folder;
  const CommandResult result = WithEndings(folder.path(), "'judge balance') exit 3;;\n");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("judge balance\n9 starts of steps took"), std::string::npos) << result.out;
}

/// Its line said that it had ended with 0.
TEST(TrainDesk, AStepThatIsKilledIsWrittenDownAsOne) {
  const TempFolder folder;
  const CommandResult result = WithEndings(folder.path(), "'train codec') kill -9 $$;;\n");
  EXPECT_EQ(result.exit_code, 128 + 9);
  const std::string times = ReadFile(folder / "out/time.csv");
  EXPECT_THAT(times, testing::MatchesRegex("collect,[0-9.]+,[0-9]+,0\npack,[0-9.]+,[0-9]+,0\ncodec,[0-9.]+,[0-9]+,137\n"));
  EXPECT_FALSE(fs::exists(folder / "out/time.step"));
}

TEST(TrainDesk, AStepThatFailsEndsIt) {
  const TempFolder folder;
  const CommandResult result = WithEndings(folder.path(), "'train codec') exit 3;;\n");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.out.find("encode"), std::string::npos) << result.out;
}

}  // namespace
}  // namespace evac
