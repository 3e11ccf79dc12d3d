#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/seed.h"
#include "harness/job.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::HasSubstr;

struct Fault {
  std::string name, stop, reason;
};

const std::vector<Fault> kFaultsByEpisode = {
    {"", "still", ""},
    {"die", "policy_error", "restarted in the middle of the episode"},
    {"hang", "policy_timeout", "no answer to request 2 within [0-9.]+ s .*deadline 3 s.*last heard"},
    {"late", "policy_timeout", "no answer to request 2 within [0-9.]+ s .*deadline 3 s"},
    {"previous", "policy_timeout", "it sent [0-9]+ answers to earlier requests"},
    {"error", "policy_error", "CUDA out of memory"},
    {"nan", "policy_error", "target 0 of 8, right arm.*nan"},
    {"short", "policy_error", "has 5 targets, wanted 8"},
    {"quaternion", "policy_error", "target 0 of 8, right arm.*norm"},
    {"outside", "policy_error", "outside the workspace"},
    {"noise", "policy_timeout", "[0-9]+ messages came that are none"},
    {"", "still", ""},
};

/// What tells the policy which of the suite's episodes this is.
std::uint64_t SeedOfEpisode(std::size_t number) {
  Job job;
  job.key.pair = {"take_bottle", fmt::format("3-{:04}", number), "faulty", "default", 1};
  job.key.world = "real";
  return job.PolicySeed();
}

TEST(PolicyFaults, EachFailsItsOwnEpisodeWithTheReasonTheOthersGoOnAndRetryFailedMakesThemGood) {
  const TempFolder folder;
  const std::string count = fmt::format("initial_states.count={}", kFaultsByEpisode.size());
  std::ofstream(folder / "sick") << "yes";
  std::string command = "faulty-policy, --while, " + (folder / "sick").string();
  for (std::size_t i = 0; i < kFaultsByEpisode.size(); ++i) {
    if (!kFaultsByEpisode[i].name.empty())
      command += fmt::format(", --fault, {}@{}", kFaultsByEpisode[i].name, SeedOfEpisode(i));
  }
  const CommandResult sick =
      RunCommand(RunWords(kFaults, folder / "run", {"policies.0.command=[" + command + "]", count}));
  EXPECT_EQ(sick.exit_code, 0) << sick.err;
  const auto episodes = nlohmann::json::parse(List(folder / "run"));
  ASSERT_EQ(episodes.size(), kFaultsByEpisode.size());
  for (std::size_t i = 0; i < episodes.size(); ++i) {
    SCOPED_TRACE(kFaultsByEpisode[i].name);
    EXPECT_EQ(episodes[i]["stop"], kFaultsByEpisode[i].stop);
    const std::string failure = episodes[i]["failure"].is_null() ? "" : episodes[i]["failure"].get<std::string>();
    const std::string& wanted = kFaultsByEpisode[i].reason;
    EXPECT_EQ(failure.empty(), wanted.empty()) << failure;
    EXPECT_THAT(failure, testing::ContainsRegex(wanted));
  }

  std::filesystem::remove(folder / "sick");
  const CommandResult retried = RunCommand({Binary("evac"), "resume", (folder / "run").string(), "--retry-failed"});
  EXPECT_EQ(retried.exit_code, 0) << retried.err;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "healthy", {count})).exit_code, 0);
  EXPECT_EQ(List(folder / "run"), List(folder / "healthy"));
}

/// A training that overwrote last.safetensors during a run: episodes of both weights stood under one hash.
TEST(PolicyFaults, FilesThatWereWrittenToSinceTheSuiteWasReadEndTheRunWhereAProcessHasReadThem) {
  const TempFolder folder;
  WriteFileAtomically(folder / "weights", "step 1");
  std::filesystem::create_directory(folder / "started");
  // It starts as the policy does, and from its N-th start on over other weights.
  const std::string script = (folder / "policy.sh").string(), weights = (folder / "weights").string();
  WriteFileAtomically(script, fmt::format("touch {0}/started/$$\n"
                                          "[ $(ls {0}/started | wc -l) -lt $1 ] || echo step 2 > {0}/weights\n"
                                          "shift\nexec {1} \"$@\"\n",
                                          folder.path().string(), Binary("faulty-policy")));
  const auto run = [&](const std::string& name, int start, const std::string& fault) {
    const std::string words = fmt::format("policies.0.command=[sh, {}, '{}'{}]", script, start, fault);
    return RunCommand(RunWords(kFaults, folder / name, {words, "policies.0.files=[" + weights + "]"}));
  };
  const auto is_told = [&](const CommandResult& result) {
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(weights + ": it is another file than when the suite was read"));
  };
  const CommandResult again = run("again", 2, fmt::format(", --fault, die@{}", SeedOfEpisode(1)));
  is_told(again);
  const auto episodes = nlohmann::json::parse(List(folder / "again"));
  ASSERT_EQ(episodes.size(), 2u) << "of the first weights, one failed as they were gone";
  EXPECT_EQ(episodes[0]["stop"], "still");
  EXPECT_EQ(episodes[1]["stop"], "policy_error");

  WriteFileAtomically(weights, "step 1");
  const CommandResult at_once = run("at_once", 1, "");
  is_told(at_once);
  EXPECT_EQ(nlohmann::json::parse(List(folder / "at_once")).size(), 0u);
}

TEST(PolicyFaults, WhenNothingWorksTheErrorBudgetEndsTheRunWithCodeFourSayingSo) {
  const TempFolder folder;
  const CommandResult result = RunCommand(
      RunWords(kFaults, folder / "run",
               {"policies.0.command=[faulty-policy, --fault, error]", "initial_states.count=12", "error_budget=0.25"}));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.err, HasSubstr("the error budget is spent: 4 episodes failed, 3 of 12 may"));
  EXPECT_THAT(result.err, HasSubstr("CUDA out of memory"));
  EXPECT_THAT(result.err, HasSubstr("evac resume " + (folder / "run").string() + " --retry-failed"));
  EXPECT_EQ(nlohmann::json::parse(List(folder / "run")).size(), 4u);
}

}  // namespace
}  // namespace evac
