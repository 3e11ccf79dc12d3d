#include "reports/real_trials_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

const KnownNames kKnown{.tasks = {"take", "put"},
                        .states = {{"take", "41-0001"}, {"take", "41-0002"}},
                        .policies = {{"p", "good"}},
                        .new_states_too = false};

RealTrialsCsv Read(const std::string& text, const KnownNames& known = kKnown) {
  return ReadRealTrialsCsv(text, "t.csv", known);
}

std::string Refusal(const std::string& text, const KnownNames& known = kKnown) {
  try {
    Read(text, known);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "accepted";
}

TEST(RealTrialsCsv, ColumnsStandInAnyOrderAndRepeatsAreNumbered) {
  const RealTrialsCsv csv = Read(
      "outcome,video,checkpoint,policy,initial_state,task,operator\r\n"
      "success,a.mp4,good,p,41-0001,take,ann\r\n0,,good,p,41-0001,take,ann\r\n\"failure\",,good,p,41-0002,take,"
      "ann\r\n");
  ASSERT_THAT(csv.trials, SizeIs(3));
  EXPECT_EQ(csv.trials[0], (RealTrial{"take", "41-0001", "p", "good", 1, Label::kSuccess, "a.mp4", "t.csv:2"}));
  EXPECT_EQ(csv.trials[1].trial, 2);
  EXPECT_EQ(csv.trials[1].outcome, Label::kFailure);
  EXPECT_EQ(csv.trials[2].trial, 1);
  EXPECT_THAT(csv.warnings, SizeIs(1));
}

TEST(RealTrialsCsv, EveryWrongLineIsNamedAndNothingIsRead) {
  const std::string refusal = Refusal(
      "task,initial_state,policy,checkpoint,outcome,trial\n"
      "take,41-0001,p,good,maybe,1\n"
      "tak,41-0001,p,good,success,1\n"
      "take,nowhere,p,good,success,1\n"
      "take,41-0002,p,gut,success,1\n"
      "take,41-0002,p,good,success\n"
      "take,41-0002,p,good,success,-3\n"
      "take,41-0002,p,good,success,7\n"
      "take,41-0002,p,good,failure,7\n");
  EXPECT_THAT(refusal, AllOf(HasSubstr("t.csv:2: column outcome: found \"maybe\""), HasSubstr("t.csv:3: column task"),
                             HasSubstr("t.csv:4: column initial_state"), HasSubstr("t.csv:5: column checkpoint")));
  EXPECT_THAT(refusal,
              AllOf(HasSubstr("t.csv:6: found 5 cells, wanted 6"), HasSubstr("t.csv:7: column trial"),
                    Not(HasSubstr("t.csv:8:")), HasSubstr("t.csv:9: column trial"), HasSubstr("nothing was imported")));
}

/// The policy was found wrong, and the word that was is not shown.
TEST(RealTrialsCsv, OfAPolicyThatIsKnownTheCheckpointIsWrong) {
  KnownNames known = kKnown;
  known.policies = {{"other", "last"}, {"p", "fair"}, {"p", "good"}};
  const auto refusal_of = [&](const std::string& policy) {
    return Refusal("task,initial_state,policy,checkpoint,outcome\ntake,41-0001," + policy + ",1\n", known);
  };
  EXPECT_THAT(refusal_of("p,god"),
              HasSubstr("t.csv:2: column checkpoint: found \"god\", wanted a checkpoint of p: fair, good"));
  EXPECT_THAT(refusal_of("q,good"),
              HasSubstr("t.csv:2: column policy: found \"q\", wanted a policy and checkpoint of the run: other,last; "
                        "p,fair; p,good"));
}

TEST(RealTrialsCsv, AFileWithoutHeaderColumnsOrRowsIsRefused) {
  EXPECT_THAT(Refusal(""), HasSubstr("empty file"));
  EXPECT_THAT(Refusal("task,policy\n"), HasSubstr("column initial_state: found it not in the header"));
  EXPECT_THAT(Refusal("task,task\n"), HasSubstr("found it twice"));
  EXPECT_THAT(Refusal("task,initial_state,policy,checkpoint,outcome\n"), HasSubstr("found no row"));
}

TEST(RealTrialsCsv, NewStatesAreAcceptedWhenAskedFor) {
  KnownNames known = kKnown;
  known.new_states_too = true;
  EXPECT_THAT(Read("task,initial_state,policy,checkpoint,outcome\nput,day 2,p,good,1\n", known).trials, SizeIs(1));
}

TEST(NewTrials, TheSameFileAgainAddsNothingAndAContradictionIsRefused) {
  const std::vector<RealTrial> trials =
      Read("task,initial_state,policy,checkpoint,outcome\ntake,41-0001,p,good,1\ntake,41-0002,p,good,0\n").trials;
  EXPECT_THAT(NewTrials(trials, {}), SizeIs(2));
  EXPECT_THAT(NewTrials(trials, trials), IsEmpty());
  std::vector<RealTrial> stored = {trials[0]};
  EXPECT_THAT(NewTrials(trials, stored), SizeIs(1));
  stored[0].outcome = Label::kFailure;
  EXPECT_THROW(NewTrials(trials, stored), Error);
}

TEST(NewTrials, OfWhatAnEarlierEvacImportedTheFilesNameAloneIsKnown) {
  const std::string rows = "task,initial_state,policy,checkpoint,outcome\ntake,41-0001,p,good,1\n";
  RealTrialsCsv csv = Read(rows);
  const std::vector<RealTrial> earlier = csv.trials;
  csv.trials.at(0).source = "/lab/monday/t.csv:2";
  EXPECT_THAT(NewTrials(csv.trials, earlier, csv.counted), IsEmpty());
  csv.trials.at(0).source = "/lab/monday/other.csv:2";
  EXPECT_THAT([&] { NewTrials(csv.trials, earlier, csv.counted); },
              testing::ThrowsMessage<Error>(HasSubstr("imported from t.csv:2")));
}

TEST(NewTrials, ARepeatFromAnotherFileIsNotTakenForWhatIsThere) {
  const std::string rows = "task,initial_state,policy,checkpoint,outcome\ntake,41-0001,p,good,1\n";
  const RealTrialsCsv first = ReadRealTrialsCsv(rows, "monday.csv", kKnown);
  const RealTrialsCsv second = ReadRealTrialsCsv(rows, "tuesday.csv", kKnown);
  EXPECT_THAT(NewTrials(first.trials, first.trials, first.counted), IsEmpty()) << "the same file again";
  EXPECT_THAT([&] { NewTrials(second.trials, first.trials, second.counted); },
              testing::ThrowsMessage<Error>(AllOf(HasSubstr("tuesday.csv:2: found no number of the trial"),
                                                  HasSubstr("imported from monday.csv:2"), HasSubstr("'trial'"))));
  const RealTrialsCsv numbered = ReadRealTrialsCsv(
      "task,initial_state,policy,checkpoint,outcome,trial\ntake,41-0001,p,good,1,1\ntake,41-0001,p,good,1,2\n",
      "tuesday.csv", kKnown);
  EXPECT_THAT(NewTrials(numbered.trials, first.trials, numbered.counted), SizeIs(1)) << "1 is there, 2 is new";
}

}  // namespace
}  // namespace evac
