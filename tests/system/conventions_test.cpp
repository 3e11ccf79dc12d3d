#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "harness/job.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::AllOf;
using testing::HasSubstr;

TEST(Conventions, WhatIsDeclaredOtherwiseIsRefusedAtTheHandshakeWithBothDeclarations) {
  const TempFolder folder;
  const CommandResult result = RunCommand(RunWords(
      kFaults, folder / "run",
      {"policies.0.command=[faulty-policy, --declare, quaternion_order=wxyz, --declare, action_space=delta, --declare, "
       "image_format=BGR, "
       "--declare, gripper_open=1, --declare, gripper_closed=0, --declare, period_s=0.0333, --declare, arms=left]"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err,
              HasSubstr("evac: policy faulty@default, which declares itself as faulty@v1, does not fit this run:\n"));
  for (const char* row :
       {"\\* quaternion_order +xyzw +wxyz", "\\* action_space +absolute +delta", "\\* image_format +RGB +BGR",
        "\\* gripper +0 open … 1 closed +1 open … 0 closed", "\\* period +0.1 s +0.0333 s", "\\* arms +right +left"})
    EXPECT_THAT(result.err, testing::ContainsRegex(row));
  EXPECT_EQ(List(folder / "run"), "[]\n");
}

/// Undeclared, each of them by one of five policies of one run.
const std::vector<std::pair<std::string, std::string>> kUndeclared = {
    {"wxyz", "it would fit if its quaternion were w x y z"},   {"delta", "it would fit if it were a delta"},
    {"millimetres", "it would fit if it were in millimetres"}, {"degrees", "the first closure is 57.3"},
    {"other_period", "are they for another period?"},          {"reversed", "is it reversed?"}};

CommandResult RunUndeclared(const std::filesystem::path& run, const std::string& probe) {
  std::string policies;
  for (const auto& [fault, said] : kUndeclared)
    policies += fmt::format("{}{{name: {}, command: [faulty-policy, --fault, {}]}}", policies.empty() ? "" : ", ",
                            fault, fault);
  return RunCommand(RunWords(
      kFaults, run, {"policies=[" + policies + "]", "initial_states.count=1", "policy={start_probe: " + probe + "}"}));
}

TEST(Conventions, WhatIsNotDeclaredIsSeenInTheFirstChunkBeforeAnyEpisodeCounts) {
  const TempFolder folder;
  const CommandResult refused = RunUndeclared(folder / "refused", "refuse");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("policy wxyz@default, task take_bottle, first chunk"), HasSubstr(kUndeclared[0].second)));
  EXPECT_EQ(List(folder / "refused"), "[]\n");

  const CommandResult warned = RunUndeclared(folder / "warned", "warn");
  EXPECT_EQ(warned.exit_code, 0) << warned.err;
  for (const auto& [fault, said] : kUndeclared)
    EXPECT_THAT(warned.err,
                testing::ContainsRegex(fmt::format("warning: policy {}@default, task take_bottle, first chunk: .*{}",
                                                   fault, said.substr(0, 15))));
}

/// Policies whose programs can be mended while a run knows them.
class MendedPolicies : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& words) const {
    std::ofstream(folder_ / name) << "exec '" << Binary("faulty-policy") << "' " << words << "\n";
  }
  std::vector<std::string> Words(const std::vector<std::string>& names) const {
    std::string policies;
    for (const std::string& name : names)
      policies += fmt::format("{}{{name: {}, command: [/bin/sh, {}]}}", policies.empty() ? "" : ", ", name,
                              (folder_ / name).string());
    return RunWords(kFaults, folder_ / "run", {"policies=[" + policies + "]", "initial_states.count=1"});
  }
  const TempFolder folder_;
};

/// What it had declared stood in the run, which had no episode, and it could never run there again.
TEST_F(MendedPolicies, OneThatWasRefusedRunsInTheSameFolderWhateverItDeclaresNow) {
  Write("p", "--fault delta");
  EXPECT_EQ(RunCommand(Words({"p"})).exit_code, 2);
  Write("p", "--declare needs=instruction");
  const CommandResult mended = RunCommand(Words({"p"}));
  EXPECT_EQ(mended.exit_code, 0) << mended.err;
}

/// Others ran first, for hours maybe.
TEST_F(MendedPolicies, OneWithEpisodesThatDeclaresOtherwiseIsRefusedBeforeAnyEpisodeOfAnother) {
  for (const char* name : {"p", "q"}) Write(name, "--fault error");
  ASSERT_EQ(RunCommand(Words({"p", "q"})).exit_code, 0);
  const std::string before = List(folder_ / "run");
  Write("p", "");
  Write("q", "--declare needs=instruction");
  const CommandResult refused = RunCommand({Binary("evac"), "resume", folder_ / "run", "--retry-failed"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("policy 'q@default' is in this run already"), HasSubstr("instruction")));
  EXPECT_EQ(List(folder_ / "run"), before);
}

/// The next episode's first chunk was asked for instead, of a policy that had been found to be as it declared.
TEST(Conventions, ARunThatGoesOnIsAskedNoMoreThanOneThatWasNeverInterrupted) {
  const TempFolder folder;
  Job third;
  third.key = {{"take_bottle", "3-0002", "faulty", "default", 1}, "real"};
  const std::string odd = fmt::format("policies.0.command=[faulty-policy, --fault, delta@{}]", third.PolicySeed());
  const CommandResult whole = RunCommand(RunWords(kFaults, folder / "run", {odd}));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const std::string before = List(folder / "run");
  EXPECT_THAT(before, HasSubstr("outside the workspace"));
  const CommandResult again = RunCommand({Binary("evac"), "resume", (folder / "run").string(), "--retry-failed"});
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(List(folder / "run"), before);
}

}  // namespace
}  // namespace evac
