#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/hash.h"
#include "core/seed.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

const std::string kSuite = EVAC_SOURCE_DIR "/tests/system/small.yaml";

std::vector<std::string> RunWords(const fs::path& run, const std::string& lanes) {
  return {Binary("evac"), "run", kSuite, "--out", run.string(), "--set", "lanes=" + lanes};
}

std::string List(const fs::path& run) { return RunCommand({Binary("evac"), "ls", run.string(), "--json"}).out; }

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
  const CommandResult straight = RunCommand(RunWords(whole, "3"));
  ASSERT_EQ(straight.exit_code, 0) << straight.err;
  const double whole_s = std::chrono::duration<double>(Clock::now() - begin).count();

  SplitMix64 random(20);
  for (int kill = 0; kill < Kills(); ++kill) {
    const pid_t pid = StartCommand(RunWords(killed, kill % 2 ? "3" : "2"), folder / "log");
    std::this_thread::sleep_for(std::chrono::duration<double>(random.Uniform(0, 1.5 * whole_s / Kills())));
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
  }
  const CommandResult last = RunCommand(RunWords(killed, "4"));
  ASSERT_EQ(last.exit_code, 0) << last.err;

  EXPECT_EQ(List(killed), List(whole));
  EXPECT_EQ(Videos(killed), Videos(whole));
  for (const auto& episode : nlohmann::json::parse(List(killed))) {
    EXPECT_EQ(Sha256HexOfFile(killed / episode["video"].get<std::string>()), episode["video_sha256"]);
  }
}

TEST(Resume, ARunIsNotContinuedWithAnotherSuite) {
  const TempFolder folder;
  const fs::path run = folder / "run";
  ASSERT_EQ(RunCommand({Binary("evac"), "run", kSuite, "--out", run.string(), "--set", "initial_states.count=1"}).exit_code, 0);
  const CommandResult other = RunCommand({Binary("evac"), "run", kSuite, "--out", run.string(), "--set", "initial_states.count=1", "--set", "seeds=[5]"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("suite"), std::string::npos) << other.err;
}

}  // namespace
}  // namespace evac
