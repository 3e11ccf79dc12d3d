#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "core/store.h"
#include "harness/suite.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::HasSubstr;

std::vector<Episode> Episodes(const std::filesystem::path& run) {
  const Store store = Store::Open(run, Store::Mode::kReadOnly);
  std::vector<Episode> episodes = store.Episodes();
  for (Episode& episode : episodes) store.LoadSteps(episode);
  EXPECT_FALSE(episodes.empty());
  return episodes;
}

TEST(Latency, WithSecondsTheWorldMovesOnTheSameForAnyNumberOfLanesAndTheReportSaysSo) {
  const TempFolder folder;
  const std::string slow = "policy={latency: 0.35}";
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "one", {slow, "lanes=1"})).exit_code, 0);
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "three", {slow, "lanes=3"})).exit_code, 0);
  EXPECT_EQ(List(folder / "one"), List(folder / "three"));
  for (const Episode& episode : Episodes(folder / "one")) {
    EXPECT_EQ(episode.commands.size(), static_cast<std::size_t>(episode.chunks) * (4 + 8))
        << "0.35 s are four periods of 0.1 s";
    for (int k = 1; k < 4; ++k)
      EXPECT_EQ(episode.commands[k][0].base_from_gripper.matrix(), episode.commands[0][0].base_from_gripper.matrix())
          << "it holds";
    EXPECT_EQ(episode.observations.size(), episode.commands.size() + 1);
  }
  ASSERT_EQ(RunCommand({Binary("evac"), "report", (folder / "one").string()}).exit_code, 0);
  EXPECT_THAT(ReadFile(folder / "one/report/index.html"), HasSubstr("0.35 s: the worlds move on"));
}

TEST(Latency, MeasuredWantsOneLaneAndCountsTheTimeThatThePolicyTook) {
  const TempFolder folder;
  const CommandResult refused =
      RunCommand(RunWords(kFaults, folder / "run", {"policy={latency: measured}", "lanes=2"}));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("lanes: 1"));

  const CommandResult measured = RunCommand(
      RunWords(kFaults, folder / "run",
               {"policy={latency: measured}", "policies.0.command=[faulty-policy, --fault, late, --late-s, \"0.5\"]",
                "transport.deadline_s=20", "initial_states.count=1"}));
  ASSERT_EQ(measured.exit_code, 0) << measured.err;
  for (const Episode& episode : Episodes(folder / "run"))
    EXPECT_GE(episode.commands.size(), static_cast<std::size_t>(episode.chunks) * 8 + 5)
        << "half a second at one request is five periods";
}

TEST(Latency, MeasuredWantsOneLaneOfResumeToo) {
  const TempFolder folder;
  const Suite suite = ReadSuite(kFaults, {"policy={latency: measured}"});
  Store::CreateOrContinue(folder / "run", {.suite_text = suite.text, .suite_hash = suite.hash, .suite_path = kFaults, .evac_version = "0"});
  const CommandResult refused = RunCommand({Binary("evac"), "resume", (folder / "run").string(), "--lanes", "2"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("--lanes: found 2"), HasSubstr("measured")));
}

TEST(Latency, WhatIsNoLatencyIsRefused) {
  const TempFolder folder;
  for (const char* latency : {"-1", "soon", "0", "61"}) {
    const CommandResult refused =
        RunCommand(RunWords(kFaults, folder / "run", {"policy={latency: " + std::string(latency) + "}"}));
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr("policy.latency")) << latency;
  }
}

}  // namespace
}  // namespace evac
