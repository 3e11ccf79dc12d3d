#include "apps/rate_resolve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "apps/rate_status.h"
#include "apps/rate_tables.h"
#include "core/error.h"
#include "core/store.h"
#include "core/store_sqlite.h"
#include "judges/rating_board.h"
#include "judges/rating_server.h"
#include "tests/judges/rating_support.h"

namespace evac {
namespace {

using testing::IsEmpty;
using testing::StartsWith;

using Stages = std::map<std::string, bool>;

/// A study whose raters say what a test wants of all its clips, and the run that their labels go to. Its task has the
/// stages reach (bit 0) and grasp (bit 1).
class Resolving : public testing::Test {
 protected:
  Resolving() {
    const Store closed = std::move(study.run().store());  // labels are written into the run
  }

  static void RateAll(AtTheDesk& rater, const std::string& label, int stages = 0) {
    for (DeskAnswer next = rater.Next(); !next.body.contains("done"); next = rater.Next()) {
      HumanVerdict verdict = rater.Watched(next.body.at("presentation"), label);
      verdict.stages = stages;
      ASSERT_EQ(rater.Say(verdict).status, 200);
    }
  }

  void Import(const std::string& rater, const std::string& label) {
    std::vector<ImportedVerdict> sheet;
    for (const StudyClip& clip : store.Clips()) sheet.push_back({2, clip.id, rater, label, ""});
    ImportVerdicts(store, sheet, "sheet.csv", 1, "test");
  }

  Resolved Resolve(bool each_rater = false) { return ResolveStudy(store, {.each_rater = each_rater}); }

  /// What the run says of the first clip by now.
  std::map<std::string, Verdict> Told() const {
    const Store run = Store::Open(store.Clips().front().run, Store::Mode::kReadOnly);
    const auto current = run.CurrentVerdicts();
    return current.at(store.Clips().front().episode);
  }

  static std::string Named(const AtTheDesk& rater) { return fmt::format("human:study:r{}", rater.id); }

  SmallStudy study{2, {.raters_per_clip = 2}};
  StudyStore store = study.Open();
  RatingDesk desk{store, {.min_repeats = 0}};
};

TEST_F(Resolving, ASheetSaysNothingOfStages) {
  Import("ann", "failure");
  Import("bob", "failure");
  Resolve(true);
  EXPECT_EQ(Told().at("human").label, Label::kFailure);
  EXPECT_THAT(Told().at("human").stages, IsEmpty());
  int raters = 0;
  for (const auto& [judge, verdict] : Told()) {
    if (!judge.starts_with("human:")) continue;
    EXPECT_THAT(verdict.stages, IsEmpty()) << judge;
    ++raters;
  }
  EXPECT_EQ(raters, 2);
}

TEST_F(Resolving, ASuccessWithoutAnyStageMarkedSaysNothingOfStages) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "success");
  RateAll(bob, "success");
  Resolve(true);
  EXPECT_EQ(Told().at("human").label, Label::kSuccess);
  EXPECT_THAT(Told().at("human").stages, IsEmpty());
  EXPECT_THAT(Told().at(Named(ann)).stages, IsEmpty());
}

TEST_F(Resolving, StagesAreVotedOnByThoseWhoTellOfThem) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "success", 3);
  RateAll(bob, "success");
  Import("cleo", "success");
  Resolve(true);
  EXPECT_EQ(Told().at("human").stages, (Stages{{"reach", true}, {"grasp", true}}));
  EXPECT_EQ(Told().at(Named(ann)).stages, (Stages{{"reach", true}, {"grasp", true}}));
  EXPECT_THAT(Told().at(Named(bob)).stages, IsEmpty());
}

TEST_F(Resolving, AFailureWithoutAnyStageMarkedReachedNone) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  Resolve();
  EXPECT_EQ(Told().at("human").stages, (Stages{{"reach", false}, {"grasp", false}}));
}

TEST_F(Resolving, WhoSawAFailureDoesNotSayThatASuccessReachedNothing) {
  AtTheDesk ann(store, desk);
  RateAll(ann, "failure");
  Import("bob", "success");
  Import("cleo", "success");
  Resolve();
  EXPECT_EQ(Told().at("human").label, Label::kSuccess);
  EXPECT_THAT(Told().at("human").stages, IsEmpty());
}

TEST_F(Resolving, VotesOfWhoLeftAreTakenBackFromTheRun) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "success", 3);
  RateAll(bob, "success", 3);
  Resolve(true);
  ASSERT_EQ(Told().at("human").label, Label::kSuccess);
  desk.Withdraw(ann.Me(), {.keep = false, .erase = false}, 9);
  EXPECT_EQ(Resolve(true).undecided, 4) << "one vote is left of each clip";
  EXPECT_THAT(Told().at("human").reason, StartsWith("too few votes"));
  EXPECT_EQ(Told().at(Named(ann)).label, Label::kCannotTell);
  EXPECT_EQ(Told().at(Named(ann)).reason, "no vote counts");
  EXPECT_EQ(Told().at(Named(bob)).label, Label::kSuccess);
  desk.Withdraw(bob.Me(), {.keep = false, .erase = true}, 9);
  const Resolved nobody = Resolve();
  EXPECT_EQ(nobody.decided + nobody.undecided, 0);
  for (const std::string& judge : {std::string("human"), Named(ann), Named(bob)}) {
    EXPECT_EQ(Told().at(judge).label, Label::kCannotTell) << judge;
    EXPECT_EQ(Told().at(judge).reason, "no vote counts") << judge;
    EXPECT_THAT(Told().at(judge).stages, IsEmpty()) << judge;
  }
  EXPECT_EQ(Resolve(true).written, 0) << "that is said once";
}

TEST_F(Resolving, AVoteThatWasUndoneIsTakenBackFromTheRun) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  Resolve();
  for (AtTheDesk* rater : {&ann, &bob}) {
    for (const StudyStore::Said& said : store.CurrentBy(rater->id))
      desk.Retract(rater->Me(), {rater->epoch, NewSecret(), said.verdict.client_uuid}, 9);
  }
  Resolve();
  EXPECT_EQ(Told().at("human").label, Label::kCannotTell);
  EXPECT_EQ(Told().at("human").reason, "no vote counts");
}

TEST_F(Resolving, WhatNobodyOfTheStudyEverVotedOnIsLeftToWhoSaidIt) {
  const StudyClip clip = store.Clips().front();
  {
    Store run = Store::Open(clip.run, Store::Mode::kReadWrite);
    Verdict of_another_study;
    of_another_study.episode_id = clip.episode;
    of_another_study.judge = "human";
    of_another_study.label = Label::kSuccess;
    run.AddVerdict(of_another_study);
  }
  EXPECT_EQ(Resolve(true).written, 0);
  EXPECT_EQ(Told().at("human").label, Label::kSuccess);
}

TEST_F(Resolving, ALabelThatTakesTheOneOfAnotherStudyIsSaidToAndNoneIsTakenBack) {
  const StudyClip clip = store.Clips().front();
  Verdict of_another_study;
  of_another_study.episode_id = clip.episode;
  of_another_study.judge = "human";
  of_another_study.label = Label::kSuccess;
  of_another_study.reason = "majority: 2 success, 0 failure, 0 cannot tell (study monday)";
  const auto say_again = [&] { Store::Open(clip.run, Store::Mode::kReadWrite).AddVerdict(of_another_study); };
  say_again();
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  EXPECT_THAT(Resolve().warnings, testing::Contains(StartsWith("1 label of judge human instead of another study's")));
  EXPECT_EQ(Told().at("human").label, Label::kFailure);
  EXPECT_EQ(Told().at("human").reason,
            fmt::format("majority: 0 success, 2 failure, 0 cannot tell (study study, id {})", store.Id()));
  EXPECT_THAT(Resolve().warnings, testing::Not(testing::Contains(testing::HasSubstr("another study"))));
  say_again();
  for (AtTheDesk* rater : {&ann, &bob}) desk.Withdraw(rater->Me(), {.keep = false, .erase = false}, 9);
  Resolve();
  EXPECT_EQ(Told().at("human").label, Label::kSuccess) << "who left this study says nothing of the other's label";
}

/// They had one signature, the name: the second one's labels took the first one's place without a word, r1 of one was
/// r1 of the other, and whose raters had left took back what the other one says.
TEST_F(Resolving, TwoStudiesOfOneNameAreToldApart) {
  const TempFolder elsewhere;
  const StudyOptions options{.runs = {study.run().folder()}, .raters_per_clip = 2, .height_px = 64};
  MakeStudy(elsewhere / "study", options, [](std::size_t, std::size_t) {});
  StudyStore other = StudyStore::Open(elsewhere / "study", StudyStore::Mode::kReadWrite);
  ASSERT_EQ(other.info().name, store.info().name);
  RatingDesk other_desk(other, {.min_repeats = 0});
  AtTheDesk ann(store, desk), bob(store, desk), cleo(other, other_desk), dan(other, other_desk);
  ASSERT_EQ(Named(ann), Named(cleo)) << "the test tests nothing";
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  RateAll(cleo, "success");
  RateAll(dan, "success");
  Resolve(true);
  const std::map<std::string, Verdict> before = Told();
  EXPECT_THAT([&] { ResolveStudy(other, {.each_rater = true}); },
              testing::ThrowsMessage<Error>(testing::AllOf(
                  testing::HasSubstr("the vote of " + Named(ann)),
                  testing::HasSubstr("another study that is named 'study'"),
                  testing::HasSubstr("wanted a study of another name (evac rate new --name)"))));
  EXPECT_EQ(Told().at("human").label, Label::kFailure) << "nothing is written then";
  EXPECT_EQ(Told().at(Named(ann)).label, Label::kFailure);
  EXPECT_THAT(ResolveStudy(other, {}).warnings,
              testing::Contains(StartsWith("4 labels of judge human instead of another study's")));
  EXPECT_EQ(Told().at("human").label, Label::kSuccess);
  for (AtTheDesk* rater : {&ann, &bob}) desk.Withdraw(rater->Me(), {.keep = false, .erase = false}, 9);
  Resolve();
  EXPECT_EQ(Told().at("human").label, Label::kSuccess) << "who left this study takes nothing of the other one back";
  EXPECT_EQ(Told().at(Named(ann)).reason, "no vote counts") << "but what they said themselves";
  EXPECT_EQ(Told().size(), before.size());
}

/// By the name alone, as earlier versions signed.
TEST_F(Resolving, ALabelThatIsSignedByNameAloneIsTheStudysOfThatName) {
  const StudyClip clip = store.Clips().front();
  Verdict before;
  before.episode_id = clip.episode;
  before.judge = "human";
  before.label = Label::kSuccess;
  before.reason = "majority: 2 success, 0 failure, 0 cannot tell (study study)";
  Store::Open(clip.run, Store::Mode::kReadWrite).AddVerdict(before);
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  EXPECT_THAT(Resolve().warnings, testing::Not(testing::Contains(testing::HasSubstr("another study"))));
  EXPECT_EQ(Told().at("human").label, Label::kFailure);
}

/// A run that was made anew in the same folder, with another checkpoint's file, has the same episode ids.
TEST_F(Resolving, AClipThatNobodySawGetsNobodysWord) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  RateAll(bob, "failure");
  const std::filesystem::path run = study.run().folder();
  StoredRun anew("anew", "sf", "sf", 16);
  const std::string there = anew.store().Episodes().front().video_sha256;
  { const Store closed = std::move(anew.store()); }
  std::filesystem::remove_all(run);
  std::filesystem::copy(anew.folder(), run, std::filesystem::copy_options::recursive);
  const std::string shown = store.Clips().front().source_sha256;
  EXPECT_THAT([&] { Resolve(true); },
              testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr(there), testing::HasSubstr(shown),
                                                           testing::HasSubstr("another than raters were shown"))));
  EXPECT_EQ(Store::Open(run, Store::Mode::kReadOnly).Judges(), std::vector<std::string>{"oracle"});
}

/// It ended with 4 in "map::at", or left the votes of who was missing out without a word.
TEST_F(Resolving, AStudyWithoutARowThatAnotherNamesIsTheUsersAndSaysWhichRow) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "success");
  RateAll(bob, "success");
  const std::pair<const char*, const char*> damages[] = {
      {"DELETE FROM rubrics", "of clips names rubric_hash '"},
      {"DROP TRIGGER clips_stay; DELETE FROM clips WHERE id = 1", "names clip '1', which clips does not have"},
      {"DELETE FROM raters WHERE id = 1", "'1', which raters does not have"},
      {"DELETE FROM study", "the table study has no row"}};
  const TempFolder copies;
  for (const auto& [sql, what] : damages) {
    const std::filesystem::path folder = copies / "study";
    std::filesystem::remove_all(folder);
    std::filesystem::copy(study.folder(), folder, std::filesystem::copy_options::recursive);
    const std::string file = (folder / "study.sqlite").string();
    sqlite::Connection::OpenReadWrite(file).RunScript(std::string("PRAGMA foreign_keys = OFF; ") + sql);
    const StudyStore damaged = StudyStore::Open(folder, StudyStore::Mode::kReadOnly);
    const std::function<void()> uses[] = {[&] { ResolveStudy(damaged, {}); }, [&] { RatingBoard(damaged, 1); },
                                          [&] { damaged.VerdictTable(); },
                                          [&] { RatingServer({.study = folder}); }};
    for (const auto& use : uses) {
      try {
        use();
        ADD_FAILURE() << sql;
      } catch (const Error& error) {
        EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput) << error.what();
        EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr(file + ": the study is damaged"),
                                                 testing::HasSubstr(what)))
            << sql;
      }
    }
  }
  EXPECT_EQ(Store::Open(study.run().folder(), Store::Mode::kReadOnly).Judges(), std::vector<std::string>{"oracle"});
}

/// The lead's board said so, and who read the same interval on a terminal was not told.
TEST_F(Resolving, TheStatusSaysHowManyReplicatesAlphasIntervalIsNotFrom) {
  AtTheDesk ann(store, desk), bob(store, desk);
  const auto status = [&] {
    testing::internal::CaptureStdout();
    PrintRatingStatus(store, 1, false);
    return testing::internal::GetCapturedStdout();
  };
  RateAll(ann, "success");
  EXPECT_THAT(status(), testing::Not(testing::HasSubstr("dropped")));
  const std::int64_t odd = store.Clips().front().id;
  bob.RateAll([odd](const StudyClip& clip) { return clip.id == odd ? "failure" : "success"; });
  EXPECT_THAT(status(), testing::ContainsRegex("alpha -?[0-9.]+ \\[.*\\] \\([1-9][0-9]* replicates without any spread "
                                               "dropped\\), Fleiss"));
}

/// It counted who said so: of four clips that neither of two raters could play "8 unplayable".
TEST_F(Resolving, TheStatusCountsClipsThatCannotBePlayedAndNotWhoSaysSo) {
  AtTheDesk ann(store, desk), bob(store, desk);
  for (AtTheDesk* rater : {&ann, &bob}) {
    for (DeskAnswer next = rater->Next(); !next.body.contains("done"); next = rater->Next())
      desk.Unplayable(rater->Me(), {rater->epoch, next.body.at("presentation"), "media error 4"}, rater->now_ms);
  }
  ASSERT_EQ(store.UnplayableClips().size(), 8u);
  testing::internal::CaptureStdout();
  PrintRatingStatus(store, 1, false);
  EXPECT_THAT(testing::internal::GetCapturedStdout(), testing::HasSubstr(" disputes, 4 unplayable\n"));
}

/// It was "0 %", as of somebody who has seen nothing but failures.
TEST_F(Resolving, TheStatusGivesWhoHasSaidNothingNoShareOfSuccesses) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "failure");
  testing::internal::CaptureStdout();
  PrintRatingStatus(store, 1, false);
  const std::string status = testing::internal::GetCapturedStdout();
  const std::string person = " +Ann +rater +active +";
  EXPECT_THAT(status, testing::ContainsRegex(fmt::format("r{}{}[1-9][0-9]* +0 % ", ann.id, person)));
  EXPECT_THAT(status, testing::ContainsRegex(fmt::format("r{}{}0 +- ", bob.id, person)));
}

TEST_F(Resolving, UnderTheNameOfAnotherJudgeOrOfNoneNothingIsWritten) {
  Import("ann", "failure");
  Import("bob", "failure");
  const std::map<std::string, Verdict> before = Told();
  for (const char* taken : {"oracle", "classifier:0123456789ab", "vlm:qwen", "", ":r1", "human,oracle"})
    EXPECT_THROW(ResolveStudy(store, {.judge = taken}), Error) << taken;
  EXPECT_EQ(Told().size(), before.size());
  EXPECT_EQ(Told().at("oracle").label, before.at("oracle").label);
  ResolveStudy(store, {.judge = "people"});
  EXPECT_EQ(Told().at("people").label, Label::kFailure);
}

/// A panel's label "human:panel" was taken, and was one more rater to reports: in alpha, and in no list of judges.
TEST_F(Resolving, APanelsLabelIsNotNamedLikeASingleRater) {
  Import("ann", "failure");
  Import("bob", "failure");
  for (const char* rater : {"human:panel", "human:study:r1", "human:"}) {
    EXPECT_THAT([&] { ResolveStudy(store, {.judge = rater}); },
                testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr(fmt::format("found '{}'", rater)),
                                                             testing::HasSubstr("does not begin with 'human:'"))));
    EXPECT_FALSE(Told().contains(rater));
  }
}

/// The report's alpha has "cannot tell" as no answer at all: two numbers of one name.
TEST_F(Resolving, TheStatusSaysThatItsAlphaHasCannotTellAsAnAnswer) {
  AtTheDesk ann(store, desk), bob(store, desk);
  RateAll(ann, "success");
  RateAll(bob, "failure");
  testing::internal::CaptureStdout();
  PrintRatingStatus(store, 1, false);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              testing::HasSubstr("agreement, \"cannot tell\" a third answer: alpha "));
}

TEST_F(Resolving, WhatAnAdjudicatorDecidedStandsWhoeverLeft) {
  AtTheDesk ann(store, desk), bob(store, desk), judge(store, desk, RaterRole::kAdjudicator);
  RateAll(ann, "success", 3);
  RateAll(bob, "failure");
  for (DeskAnswer next = judge.Next(); !next.body.contains("done"); next = judge.Next()) {
    const std::string clip = next.body.at("presentation");
    judge.Say(clip, "failure");
    HumanVerdict last = judge.Watched(clip, "failure");
    last.supersedes = store.CurrentVerdict(clip)->id;
    last.is_final = true;
    ASSERT_EQ(judge.Say(last).status, 200);
  }
  for (AtTheDesk* rater : {&ann, &bob}) desk.Withdraw(rater->Me(), {.keep = false, .erase = false}, 9);
  EXPECT_EQ(Resolve().decided, 4);
  EXPECT_EQ(Told().at("human").label, Label::kFailure);
  EXPECT_THAT(Told().at("human").reason, StartsWith("adjudicated"));
  EXPECT_THAT(Told().at("human").stages, IsEmpty());
}

}  // namespace
}  // namespace evac
