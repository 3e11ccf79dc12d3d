#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/store.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kSuite = EVAC_SOURCE_DIR "/tests/system/small.yaml";

class Refusals : public ::testing::Test {
 protected:
  CommandResult Run(const std::vector<std::string>& assignments, const std::string& suite = kSuite) {
    std::vector<std::string> words = {Binary("evac"), "run", suite, "--out", (folder_ / "run").string()};
    for (const std::string& assignment : assignments) words.insert(words.end(), {"--set", assignment});
    return RunCommand(words);
  }
  TempFolder folder_;
};

TEST_F(Refusals, ATypoInASuiteIsNamedAndNothingIsWritten) {
  const CommandResult result = Run({"initial_state={seed: 1, count: 1}"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("initial_state"), HasSubstr("'initial_states'")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "run"));
}

TEST_F(Refusals, AMissingSuiteOrProgramOrRunIsInvalidInput) {
  EXPECT_EQ(RunCommand({Binary("evac"), "run", "/nowhere/suite.yaml", "--out", (folder_ / "run").string()}).exit_code, 2);
  EXPECT_EQ(RunCommand({Binary("evac"), "ls", (folder_ / "nothing").string()}).exit_code, 2);
  EXPECT_EQ(RunCommand({Binary("evac"), "frobnicate"}).exit_code, 2);
  const CommandResult program = Run({"policies.0.command=[no-such-policy]"});
  EXPECT_EQ(program.exit_code, 2);
  EXPECT_THAT(program.err, HasSubstr("no-such-policy"));
}

TEST_F(Refusals, AnOutThatIsAFileIsInvalidInputAndNamed) {
  std::ofstream(folder_ / "run") << "mine";
  const CommandResult result = Run({});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("evac: " + (folder_ / "run").string() + ":"));
}

/// All that was below OUT/videos and OUT/thumbs went without a word.
TEST_F(Refusals, AnOutWithVideosOfSomebodysIsInvalidInputAndTheyStay) {
  const std::filesystem::path videos = folder_ / "run/videos";
  std::filesystem::create_directories(videos);
  std::ofstream(videos / "own.mp4") << "mine";
  const CommandResult result = Run({});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("evac: " + videos.string() + ":"));
  EXPECT_TRUE(std::filesystem::exists(videos / "own.mp4"));
}

/// It said "confidence is -1".
TEST_F(Refusals, ARiskOfAComparisonThatIsNoShareIsNamedAsTheOption) {
  for (const char* option : {"--alpha", "--power"}) {
    for (const char* found : {"2", "0", "1", "nan"}) {
      const CommandResult result = RunCommand({Binary("evac"), "compare", "a", "b", "--run", folder_.path().string(), option, found});
      EXPECT_EQ(result.exit_code, 2);
      EXPECT_THAT(result.err, AllOf(HasSubstr(std::string("compare: ") + option + " is "), HasSubstr("wanted between 0 and 1")));
    }
  }
}

/// It passed every range, being neither below nor above anything.
TEST_F(Refusals, ANumberThatIsNoneIsNamedAsTheOption) {
  const std::string none = (folder_ / "none").string();
  const std::pair<std::vector<std::string>, const char*> options[] = {
      {{"evac", "rate", "serve", none}, "--cover"},
      {{"evac", "pack", none, "--config", none, "--out", none}, "--holdout"},
      {{"evac", "imagine", "--out", none}, "--cfg"},
      {{"evac", "plan"}, "--rate"},
      {{"evac-policy", "hold"}, "--period-s"},
      {{"evac-policy", "visual_pick"}, "--noise-m"}};
  for (auto [words, option] : options) {
    words.front() = Binary(words.front());
    words.insert(words.end(), {option, "nan"});
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_THAT(result.err, AllOf(HasSubstr(option + 2), HasSubstr("nan")));
  }
}

TEST_F(Refusals, MoreTrialsThanCanBeCountedAreRefusedAndNotCountedForEver) {
  const CommandResult result = RunCommand({Binary("evac"), "plan", "--trials", "99999999999"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("plan: --trials is 99999999999, wanted at most 100000"));
}

TEST_F(Refusals, AnOptionThatIsNoNumberIsInvalidInput) {
  const CommandResult result = RunCommand({Binary("evac"), "judge", "train", folder_.path().string(), "--height-px", "abc",
                                           "--out", (folder_ / "judge").string()});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("--height-px"), HasSubstr("found abc, wanted a multiple of 8")));
}

TEST_F(Refusals, APolicyWithAnotherPeriodEndsTheRunBeforeItStartsWithBothDeclarations) {
  const CommandResult result = Run({"policies.0.command=[evac-policy, hold, --period-s, \"0.25\"]"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("period"), HasSubstr("0.25"), HasSubstr("0.1")));
}

TEST_F(Refusals, ASecondPolicyThatDoesNotFitOrIsNotThereEndsTheRunBeforeTheFirstsEpisodes) {
  const CommandResult unfit = Run({"policies.1.command=[evac-policy, hold, --period-s, \"0.25\"]"});
  EXPECT_EQ(unfit.exit_code, 2);
  EXPECT_THAT(unfit.err, AllOf(HasSubstr("period"), HasSubstr("0.25"), HasSubstr("0.1")));
  EXPECT_TRUE(Store::Open(folder_ / "run", Store::Mode::kReadOnly).Episodes().empty());
  std::filesystem::remove_all(folder_ / "run");
  const CommandResult absent = Run({"policies.1.command=[no-such-policy]"});
  EXPECT_EQ(absent.exit_code, 2);
  EXPECT_THAT(absent.err, HasSubstr("no-such-policy"));
  EXPECT_TRUE(Store::Open(folder_ / "run", Store::Mode::kReadOnly).Episodes().empty());
}

TEST_F(Refusals, AProgramThatIsNoPolicyIsRefusedAfterItsTimeToStart) {
  const CommandResult result = Run({"policies.0.command=[sleep, \"60\"]", "transport={start_s: 1}"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("no policy answered within 1 s on "));
  EXPECT_THAT(result.err, HasSubstr("evac: policy visual_pick@good: "));
  EXPECT_THAT(result.err, HasSubstr("its output: " + (folder_ / "run/logs/visual_pick@good.log").string() +
                                    "; `transport.start_s` gives it longer"));
  EXPECT_THAT(result.err, ::testing::Not(HasSubstr("EVAC_TOKEN"))) << "nobody is to join";
}

TEST_F(Refusals, APolicyThatIsJoinedAndNotThereIsNamedWithHowItJoins) {
  const CommandResult result = Run({"policies.0={name: far, join: {url: \"udpm://239.255.76.67:29998?ttl=0\", token: nobody}}",
                                    "transport={start_s: 1}"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("evac: policy far@default: no policy answered within 1 s on "),
                                HasSubstr("EVAC_TOKEN")));
  EXPECT_THAT(result.err, ::testing::Not(HasSubstr("its output")));
}

TEST_F(Refusals, AProgramThatIsNotInTheSuitesFolderIsToldWhereItWasLookedFor) {
  const CommandResult result = Run({"policies.0.command=[./mine]"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("names ./mine: found no program at " EVAC_SOURCE_DIR "/tests/system/mine"),
                                HasSubstr("in the suite's folder, also with --set")));
}

TEST_F(Refusals, APolicyThatHangsFailsItsEpisodesAndTheBudgetEndsTheRunSayingSo) {
  const CommandResult result = Run({"policies.0.command=[faulty-policy, --fault, hang]", "error_budget=0",
                                    "transport={deadline_s: 1, repeat_after_s: 0.3}", "initial_states.count=40", "lanes=2"},
                                   EVAC_SOURCE_DIR "/tests/system/faults.yaml");
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.err, AllOf(HasSubstr("error budget"), HasSubstr("evac resume")));
}

TEST_F(Refusals, AValidSuiteIsCalledValidWithItsNumberOfEpisodes) {
  const CommandResult result = RunCommand({Binary("evac"), "validate", kSuite});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("= 16 episodes"));
}

}  // namespace
}  // namespace evac
