#include "judges/rating_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/error.h"
#include "core/store_sqlite.h"
#include "judges/rating_board.h"
#include "judges/rating_tally.h"
#include "tests/judges/rating_support.h"

/// What docs/rating_session.md says becomes of what happens during a session, as far as it is the server's.
namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

class RatingDeskTest : public testing::Test {
 protected:
  std::int64_t Rows() { return static_cast<std::int64_t>(store.VerdictTable().rows.size()); }

  SmallStudy study{8, {.raters_per_clip = 2}};
  StudyStore store = study.Open();
  RatingDesk desk{store, {.app_version = "test"}};
};

TEST_F(RatingDeskTest, ALinkIsForOnePersonButALostAnswerMayBeAskedForAgain) {
  AtTheDesk ann(store, desk);
  EXPECT_EQ(desk.Join({ann.link, NewSecret(), "Eve"}, 1).status, 410);
  const DeskAnswer again = desk.Join({ann.link, ann.uuid, "Ann"}, 1);
  EXPECT_EQ(again.status, 200);
  EXPECT_NE(again.session, ann.session);
  EXPECT_EQ(store.RaterOfSession(again.session)->id, ann.id);
  EXPECT_EQ(desk.Join({NewSecret(), NewSecret(), "Eve"}, 1).status, 404);
  EXPECT_EQ(store.Raters().size(), 1u);
}

TEST_F(RatingDeskTest, ADoubleClickOrARetryAfterALostAnswerIsOneVerdict) {
  AtTheDesk ann(store, desk);
  const HumanVerdict verdict = ann.Watched(ann.Next().body.at("presentation"), "success");
  const DeskAnswer first = ann.Say(verdict), second = ann.Say(verdict);
  EXPECT_EQ(first.status, 200);
  EXPECT_EQ(second.status, 200);
  EXPECT_EQ(first.body.at("verdict"), second.body.at("verdict"));
  EXPECT_EQ(Rows(), 1);
}

TEST_F(RatingDeskTest, ARetryIsAnsweredAlsoAfterAnotherTabTookOver) {
  AtTheDesk ann(store, desk);
  const HumanVerdict verdict = ann.Watched(ann.Next().body.at("presentation"), "success");
  ann.Say(verdict);
  ann.TakeTab();
  EXPECT_EQ(ann.Say(verdict).status, 200);
  EXPECT_EQ(Rows(), 1);
}

TEST_F(RatingDeskTest, AnotherVerdictOfAnAnsweredClipIsRefusedUnlessItReplacesTheStoredOne) {
  AtTheDesk ann(store, desk);
  const std::string clip = ann.Next().body.at("presentation");
  const std::int64_t first = ann.Say(clip, "success").body.at("verdict").at("id");
  const DeskAnswer refused = ann.Say(clip, "failure");
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(refused.body.at("error"), "answered");
  EXPECT_EQ(refused.body.at("verdict").at("label"), "success");
  HumanVerdict replaces = ann.Watched(clip, "failure");
  replaces.supersedes = first;
  EXPECT_EQ(ann.Say(replaces).status, 200);
  HumanVerdict late = ann.Watched(clip, "success");
  late.supersedes = first;
  EXPECT_EQ(ann.Say(late).status, 409) << "what was replaced cannot be replaced again";
  EXPECT_EQ(store.CurrentVerdict(clip)->label, "failure");
  EXPECT_EQ(Rows(), 2) << "nothing is overwritten";
}

TEST_F(RatingDeskTest, UndoAddsARowAndTheClipIsAskedAgain) {
  AtTheDesk ann(store, desk);
  const std::string clip = ann.Next().body.at("presentation");
  const HumanVerdict verdict = ann.Watched(clip, "success");
  ann.Say(verdict);
  const std::string other = ann.Next().body.at("presentation");
  const RetractBody undo{ann.epoch, NewSecret(), verdict.client_uuid};
  EXPECT_EQ(desk.Retract(ann.Me(), undo, 2).status, 200);
  EXPECT_EQ(desk.Retract(ann.Me(), undo, 2).status, 200) << "sent twice, done once";
  EXPECT_EQ(Rows(), 2);
  EXPECT_FALSE(store.CurrentVerdict(clip));
  EXPECT_EQ(store.Votes()[store.FindPresentation(clip)->clip], 0);
  EXPECT_EQ(ann.Next().body.at("presentation"), clip);
  EXPECT_EQ(ann.Say(clip, "failure").status, 200);
  EXPECT_EQ(store.CurrentVerdict(clip)->label, "failure");
  EXPECT_NE(clip, other);
}

TEST_F(RatingDeskTest, AnOldTabChangesNothing) {
  AtTheDesk ann(store, desk);
  const std::string clip = ann.Next().body.at("presentation");
  const HumanVerdict from_old_tab = ann.Watched(clip, "success");
  ann.TakeTab();
  EXPECT_EQ(ann.Say(from_old_tab).body.at("error"), "tab");
  EXPECT_EQ(desk.Next(ann.Me(), {ann.epoch - 1, {}}, 1).body.at("error"), "tab");
  EXPECT_EQ(desk.Heartbeat(ann.Me(), {ann.epoch - 1, clip, ""}, 1).status, 409);
  EXPECT_EQ(desk.Unplayable(ann.Me(), {ann.epoch - 1, clip, ""}, 1).status, 409);
  EXPECT_EQ(Rows(), 0);
}

TEST_F(RatingDeskTest, ManyRatersGiveEachClipTheVotesItWantsAndNoMore) {
  AtTheDesk ann(store, desk), bob(store, desk), eve(store, desk);
  const auto label = [](const StudyClip&) { return "success"; };
  const int total = ann.RateAll(label) + bob.RateAll(label) + eve.RateAll(label);
  const auto clips = static_cast<int>(store.Clips().size());
  EXPECT_GE(total, 2 * clips);
  for (const StudyClip& clip : store.Clips()) EXPECT_EQ(store.Votes()[clip.id], 2) << clip.episode;
}

TEST_F(RatingDeskTest, ALeaseHoldsAPlaceUntilItExpiresAndALateVoteStillCounts) {
  AtTheDesk ann(store, desk), bob(store, desk), eve(store, desk);
  std::set<std::int64_t> of_ann;
  std::vector<std::string> held;
  for (DeskAnswer next = ann.Next(); !next.body.contains("done"); next = ann.Next(held)) {
    held.push_back(next.body.at("presentation"));  // takes every clip and answers none
    of_ann.insert(store.FindPresentation(held.back())->clip);
  }
  EXPECT_EQ(of_ann.size(), store.Clips().size());
  const auto label = [](const StudyClip&) { return "failure"; };
  bob.RateAll(label);
  EXPECT_EQ(eve.RateAll(label), 0) << "one vote and one lease: no place is free";
  eve.now_ms += 600'001;
  EXPECT_GT(eve.RateAll(label), 0) << "the leases are over";
  ann.now_ms += 600'001;
  const std::string late = held.front();
  EXPECT_EQ(ann.Say(late, "success").status, 200);
  EXPECT_EQ(store.Votes()[store.FindPresentation(late)->clip], 3) << "N + 1, never thrown away";
}

TEST_F(RatingDeskTest, AReloadGoesOnWithTheSameClip) {
  AtTheDesk ann(store, desk);
  const DeskAnswer before = ann.Next();
  ann.TakeTab();
  EXPECT_EQ(ann.Next().body.at("presentation"), before.body.at("presentation"));
  EXPECT_NE(ann.Next({before.body.at("presentation")}).body.at("presentation"), before.body.at("presentation"))
      << "what the tab holds already is not given again";
}

TEST_F(RatingDeskTest, AClipThatCannotBePlayedIsNobodysVote) {
  AtTheDesk ann(store, desk);
  const std::string clip = ann.Next().body.at("presentation");
  EXPECT_EQ(desk.Unplayable(ann.Me(), {ann.epoch, clip, "media error 4"}, 5).status, 200);
  EXPECT_NE(ann.Next().body.at("presentation"), clip);
  EXPECT_EQ(Rows(), 0);
  const auto told = store.UnplayableClips();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].reason, "media error 4");
  EXPECT_EQ(told[0].clip, store.FindPresentation(clip)->clip);
}

TEST_F(RatingDeskTest, AVerdictWithoutWatchingIsRefused) {
  AtTheDesk ann(store, desk);
  HumanVerdict verdict = ann.Watched(ann.Next().body.at("presentation"), "success");
  verdict.coverage = 0.5;
  EXPECT_EQ(ann.Say(verdict).status, 422);
  verdict.coverage = 0.9;
  EXPECT_EQ(ann.Say(verdict).status, 200);
  HumanVerdict changed = ann.Watched(verdict.presentation, "success");
  changed.coverage = 0.1;
  EXPECT_EQ(ann.Say(changed).status, 409) << "it replaces nothing";
  changed.supersedes = store.CurrentVerdict(verdict.presentation)->id;
  EXPECT_EQ(ann.Say(changed).status, 200) << "it was watched for the first word";
  EXPECT_EQ(store.CurrentVerdict(verdict.presentation)->coverage, 0.1) << "what was seen since, no more";
}

TEST_F(RatingDeskTest, HowSureARaterWasComesBackWithTheVerdict) {
  AtTheDesk ann(store, desk);
  HumanVerdict sure = ann.Watched(ann.Next().body.at("presentation"), "success");
  sure.confidence = 3;
  EXPECT_EQ(ann.Say(sure).body.at("verdict").at("confidence"), 3);
  ann.Say(ann.Next().body.at("presentation"), "failure");
  const auto said = desk.History(ann.Me()).body.at("verdicts");
  EXPECT_TRUE(said[0].at("confidence").is_null()) << "nothing was said";
  EXPECT_EQ(said[1].at("confidence"), 3);
  const auto opened = desk.Open(ann.Me(), {ann.epoch, sure.presentation, ""}, ann.now_ms).body;
  EXPECT_EQ(opened.at("verdict").at("confidence"), 3) << "what Change begins with";
}

TEST_F(RatingDeskTest, ProgressIsOfTheClipsThatARaterIsAskedAndWholeWhenNoneIsLeft) {
  AtTheDesk ann(store, desk), bob(store, desk), eve(store, desk);
  const auto label = [](const StudyClip&) { return "success"; };
  const auto of = [&](const AtTheDesk& who, const char* what) -> std::int64_t {
    return desk.Me(who.Me(), who.now_ms).body.at("progress").at(what);
  };
  EXPECT_EQ(of(ann, "total"), 16 + 2) << "two of them twice";
  EXPECT_EQ(ann.RateAll(label), 18);
  EXPECT_EQ(of(ann, "done"), 18);
  for (int i = 0; i < 6; ++i) bob.Say(bob.Next().body.at("presentation"), "success");
  EXPECT_LE(of(eve, "total"), 10 + 2) << "six clips have their two votes";
  EXPECT_EQ(desk.Unplayable(eve.Me(), {eve.epoch, eve.Next().body.at("presentation"), "media error 4"}, 5).status, 200);
  EXPECT_EQ(of(eve, "done"), 0) << "what cannot be played is nobody's vote";
  const std::int64_t asked = of(eve, "total");
  EXPECT_LE(asked, 9 + 2);
  EXPECT_EQ(eve.RateAll(label), asked);
  EXPECT_EQ(of(eve, "done"), asked);
  EXPECT_EQ(of(eve, "total"), asked);
  EXPECT_LT(of(bob, "total"), 16) << "eve has left bob few";
  bob.RateAll(label);
  EXPECT_EQ(of(bob, "done"), of(bob, "total"));
  desk.Withdraw(eve.Me(), {.keep = false, .erase = false}, 9);
  EXPECT_GT(of(bob, "total"), of(bob, "done")) << "her clips want votes again";
  bob.RateAll(label);
  EXPECT_EQ(of(bob, "done"), of(bob, "total"));
}

TEST_F(RatingDeskTest, AnAdjudicatorsProgressIsOfTheDisputesThatWait) {
  AtTheDesk ann(store, desk), bob(store, desk);
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip&) { return "failure"; });
  AtTheDesk judge(store, desk, RaterRole::kAdjudicator), other(store, desk, RaterRole::kAdjudicator);
  const auto decide = [&](AtTheDesk& who) {
    const std::string clip = who.Next().body.at("presentation");
    who.Say(clip, "success");
    HumanVerdict last = who.Watched(clip, "success");
    last.supersedes = store.CurrentVerdict(clip)->id;
    last.is_final = true;
    return who.Say(last).body.at("progress");
  };
  using Json = nlohmann::ordered_json;
  EXPECT_EQ(judge.Next().body.at("progress"), (Json{{"done", 0}, {"total", 16}, {"practice_left", 0}}));
  EXPECT_EQ(decide(other), (Json{{"done", 1}, {"total", 16}, {"practice_left", 0}}));
  EXPECT_EQ(decide(judge), (Json{{"done", 1}, {"total", 15}, {"practice_left", 0}})) << "one was decided by another";
}

TEST_F(RatingDeskTest, OthersClipsAreNotThere) {
  AtTheDesk ann(store, desk), bob(store, desk);
  const std::string of_ann = ann.Next().body.at("presentation");
  EXPECT_EQ(bob.Say(of_ann, "success").status, 404);
  EXPECT_FALSE(desk.ClipFile(bob.Me(), of_ann));
  EXPECT_TRUE(desk.ClipFile(ann.Me(), of_ann));
  EXPECT_FALSE(desk.ClipFile(ann.Me(), store.PresentationsOf(ann.id).back().id)) << "not shown yet";
  HumanVerdict verdict = ann.Watched(of_ann, "success");
  ann.Say(verdict);
  HumanVerdict stolen = bob.Watched(bob.Next().body.at("presentation"), "failure");
  stolen.client_uuid = verdict.client_uuid;
  EXPECT_EQ(bob.Say(stolen).status, 409) << "another's uuid shows nothing of theirs";
  EXPECT_EQ(desk.Retract(bob.Me(), {bob.epoch, NewSecret(), verdict.client_uuid}, 1).status, 404);
}

TEST_F(RatingDeskTest, WhoLeavesDecidesWhetherTheVerdictsCount) {
  AtTheDesk ann(store, desk), bob(store, desk), eve(store, desk);
  const auto label = [](const StudyClip&) { return "success"; };
  HumanVerdict noted = ann.Watched(ann.Next().body.at("presentation"), "success");
  noted.note = "my name is Ann";
  noted.viewport = "1280x800";
  ann.Say(noted);
  bob.RateAll(label);
  eve.RateAll(label);
  const std::int64_t clip = store.FindPresentation(noted.presentation)->clip;
  const std::int64_t before = store.Votes()[clip];
  desk.Withdraw(ann.Me(), {.keep = false, .erase = true}, 9);
  EXPECT_EQ(store.Votes()[clip], before - 1);
  EXPECT_FALSE(store.RaterOfSession(ann.session)) << "the session is over";
  EXPECT_EQ(desk.Join({ann.link, ann.uuid, ""}, 9).status, 410);
  EXPECT_EQ(store.Rater(ann.id).name, "");
  EXPECT_EQ(store.VerdictByUuid(noted.client_uuid)->note, "");
  EXPECT_EQ(store.VerdictByUuid(noted.client_uuid)->ua_hash, "");
  EXPECT_EQ(store.VerdictByUuid(noted.client_uuid)->label, "success") << "the row itself stays";
  EXPECT_EQ(store.VerdictByUuid(noted.client_uuid)->viewport, "1280x800") << "with how the clip was watched";
  desk.Withdraw(bob.Me(), {.keep = true, .erase = false}, 9);
  EXPECT_EQ(store.Rater(bob.id).status, "withdrawn");
  EXPECT_TRUE(store.Rater(bob.id).counts);
}

TEST_F(RatingDeskTest, NothingARaterSeesTellsWhereAClipComesFrom) {
  AtTheDesk ann(store, desk);
  std::string seen = desk.Me(ann.Me(), 1).body.dump() + desk.Examples(ann.Me()).body.dump();
  for (DeskAnswer next = ann.Next(); !next.body.contains("done"); next = ann.Next()) {
    seen += next.body.dump() + ann.Say(next.body.at("presentation"), "success").body.dump();
  }
  seen += desk.History(ann.Me()).body.dump() + desk.Mine(ann.Me()).body.dump() + desk.ToGuess(ann.Me()).body.dump();
  for (const char* tell : {"pick", "sim", "41-0", "is_real", "gold", "repeat\"", "clips/", ".mp4"})
    EXPECT_THAT(seen, Not(HasSubstr(tell)));
  for (const StudyClip& clip : store.Clips()) EXPECT_THAT(seen, Not(HasSubstr(clip.video_sha256)));
}

TEST_F(RatingDeskTest, AWaveThatComesLaterLeavesOrdersAsTheyWere) {
  AtTheDesk ann(store, desk);
  const auto before = store.PresentationsOf(ann.id);
  study.run().Add("41-0100", 's', 'f');
  MakeStudy(study.folder(), {.runs = {study.run().folder()}, .height_px = 64}, [](std::size_t, std::size_t) {});
  desk.Me(ann.Me(), 3);
  const auto after = store.PresentationsOf(ann.id);
  ASSERT_EQ(after.size(), before.size() + 2);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(after[i].id, before[i].id);
  EXPECT_EQ(store.Waves(), 2);
  EXPECT_EQ(store.Clip(after.back().clip).wave, 2);
}

/// "Download my data" told which clips came with a later wave, of another checkpoint, say.
TEST_F(RatingDeskTest, WhatARaterDownloadsDoesNotTellWaves) {
  AtTheDesk ann(store, desk);
  study.run().Add("41-0100", 's', 'f');
  MakeStudy(study.folder(), {.runs = {study.run().folder()}, .height_px = 64}, [](std::size_t, std::size_t) {});
  desk.Me(ann.Me(), 3);
  ann.RateAll([](const StudyClip&) { return "success"; });
  std::set<std::string> told, kept;
  const auto mine = desk.Mine(ann.Me()).body;
  for (const auto& row : mine.at("verdicts")) told.insert(row.value("wave", ""));
  EXPECT_THAT(told, testing::ElementsAre(""));
  const StudyTable table = store.VerdictTable();
  const auto wave = std::ranges::find(table.columns, "wave") - table.columns.begin();
  for (const auto& row : table.rows) kept.insert(row.at(static_cast<std::size_t>(wave)));
  EXPECT_THAT(kept, testing::ElementsAre("1", "2")) << "the lead's export has them";
}

TEST_F(RatingDeskTest, AdjudicatorsSayWhatTheySeeBeforeTheySeeTheOthers) {
  AtTheDesk ann(store, desk), bob(store, desk), judge(store, desk, RaterRole::kAdjudicator);
  EXPECT_TRUE(judge.Next().body.contains("done")) << "nothing is split yet";
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip& clip) { return clip.initial_state == "41-0003" ? "failure" : "success"; });
  const DeskAnswer dispute = judge.Next();
  ASSERT_TRUE(dispute.body.contains("presentation"));
  EXPECT_EQ(dispute.body.at("kind"), "adjudication");
  EXPECT_FALSE(dispute.body.contains("others"));
  const std::string clip = dispute.body.at("presentation");
  HumanVerdict hasty = judge.Watched(clip, "failure");
  hasty.is_final = true;
  EXPECT_EQ(judge.Say(hasty).body.at("error"), "blind");
  const DeskAnswer first = judge.Say(clip, "success");
  ASSERT_EQ(first.body.at("others").size(), 2u);
  EXPECT_EQ(judge.Next().body.at("others").size(), 2u) << "a reload goes on there";
  HumanVerdict changed = judge.Watched(clip, "failure");
  changed.supersedes = first.body.at("verdict").at("id").get<std::int64_t>();
  EXPECT_EQ(judge.Say(changed).status, 409) << "blind no more: only the decision is left";
  changed.is_final = true;
  EXPECT_EQ(judge.Say(changed).status, 200);
  const std::int64_t decided = store.FindPresentation(clip)->clip;
  RatingTally tally;
  tally.Read(store);
  int found = 0;
  for (const RatedClip& rated : tally.rated()) {
    if (rated.clip.id != decided) continue;
    ++found;
    EXPECT_EQ(rated.resolution.how, "adjudicated");
    EXPECT_EQ(rated.resolution.label, Label::kFailure);
  }
  EXPECT_EQ(found, 1);
  EXPECT_EQ(store.Disputes().size(), 1u) << "the real and the sim clip of one state were split";
  HumanVerdict usurped = ann.Watched(store.PresentationsOf(ann.id)[0].id, "failure");
  usurped.is_final = true;
  EXPECT_EQ(ann.Say(usurped).status, 403);
}

TEST_F(RatingDeskTest, WhatAnAdjudicatorWhoLeftDecidedIsGivenToAnother) {
  AtTheDesk ann(store, desk), bob(store, desk);
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip&) { return "failure"; });
  AtTheDesk eve(store, desk, RaterRole::kAdjudicator), fay(store, desk, RaterRole::kAdjudicator);
  const std::size_t split = store.Disputes().size();
  const std::string clip = eve.Next().body.at("presentation");
  eve.Say(clip, "success");
  HumanVerdict last = eve.Watched(clip, "success");
  last.supersedes = store.CurrentVerdict(clip)->id;
  last.is_final = true;
  ASSERT_EQ(eve.Say(last).status, 200);
  EXPECT_EQ(store.Disputes().size(), split - 1);
  desk.Withdraw(eve.Me(), {.keep = false, .erase = false}, 9);
  EXPECT_EQ(store.Disputes().size(), split);
  RatingTally tally;
  tally.Read(store);
  EXPECT_EQ(tally.Disputes(), store.Disputes());
  const std::string given = fay.Next().body.at("presentation");
  EXPECT_EQ(store.FindPresentation(given)->clip, store.FindPresentation(clip)->clip) << "the first of them again";
}

TEST_F(RatingDeskTest, TheBoardGivesItsRowsInPagesDisputesFirstAndItsNumbersOfAll) {
  AtTheDesk ann(store, desk), bob(store, desk);
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip& clip) { return clip.initial_state == "41-0003" ? "failure" : "success"; });
  const auto whole = RatingBoard(store, 0);
  ASSERT_EQ(whole.at("clips").size(), 16u);
  ASSERT_EQ(whole.at("disputes").size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(whole.at("clips")[i].at("clip"), whole.at("disputes")[i]);
  auto rows = nlohmann::ordered_json::array();
  for (std::size_t from = 0; from < 16; from += 5) {
    const auto page = RatingBoard(store, 0, {.from = from, .count = 5});
    EXPECT_EQ(page.at("clips_from"), from);
    for (const auto& row : page.at("clips")) rows.push_back(row);
    EXPECT_EQ(page.at("rates"), whole.at("rates"));
    EXPECT_EQ(page.at("progress"), whole.at("progress"));
  }
  EXPECT_EQ(rows, whole.at("clips"));
  EXPECT_TRUE(RatingBoard(store, 0, {.from = 17, .count = 5}).at("clips").empty());
}

TEST_F(RatingDeskTest, AStudyOfAnEarlierEvacIsMadeQuickWhenItIsOpened) {
  {
    sqlite::Connection old = sqlite::Connection::OpenReadWrite(study.folder() / "study.sqlite");
    old.RunScript("DROP INDEX presentations_to_come; CREATE INDEX presentations_of_clip ON presentations (clip)");
  }
  StudyStore reopened = study.Open();
  RatingDesk again(reopened, {});
  AtTheDesk ann(reopened, again);
  EXPECT_TRUE(ann.Next().body.contains("presentation"));
}

TEST(RatingDeskGold, PracticeTellsWhatIsKnownAndGoldDoesNot) {
  SmallStudy study(16, {.gold_from = "oracle"});
  StudyStore store = study.Open();
  RatingDesk desk(store, {});
  EXPECT_EQ(study.made.examples, 4);
  EXPECT_EQ(study.made.practice, 8);
  EXPECT_EQ(study.made.gold, 8);
  AtTheDesk ann(store, desk);
  for (int i = 0; i < 8; ++i) {
    const DeskAnswer next = ann.Next();
    EXPECT_EQ(next.body.at("kind"), "practice");
    EXPECT_FALSE(next.body.contains("feedback"));
    const DeskAnswer said = ann.Say(next.body.at("presentation"), "failure");
    EXPECT_THAT((std::vector<std::string>{"success", "failure"}),
                testing::Contains(said.body.at("feedback").at("label").get<std::string>()));
  }
  int gold = 0;
  for (DeskAnswer next = ann.Next(); !next.body.contains("done"); next = ann.Next()) {
    EXPECT_EQ(next.body.at("kind"), "clip");
    gold += store.FindPresentation(next.body.at("presentation"))->showing == Showing::kGold ? 1 : 0;
    EXPECT_FALSE(ann.Say(next.body.at("presentation"), "failure").body.contains("feedback"));
  }
  EXPECT_EQ(gold, 8);
  EXPECT_EQ(desk.Examples(ann.Me()).body.at("examples").size(), 4u);
}

TEST(StudyTruth, WhatAKillBeforeTheFirstCommitLeftMakesRoomForAStudy) {
  SmallStudy other(2);
  const TempFolder folder;
  sqlite::Connection::OpenReadWrite(folder / "study.sqlite");
  EXPECT_THAT([&] { StudyStore::Open(folder.path(), StudyStore::Mode::kReadOnly); },
              testing::ThrowsMessage<Error>(HasSubstr("there is no study (study.sqlite was never begun)")));
  MakeStudy(folder.path(), {.runs = {other.run().folder()}, .height_px = 64}, [](std::size_t, std::size_t) {});
  EXPECT_FALSE(StudyStore::Open(folder.path(), StudyStore::Mode::kReadOnly).Clips().empty());
  EXPECT_THAT([&] { StudyStore::Create(folder.path(), {}); },
              testing::ThrowsMessage<Error>(HasSubstr("there is a study already")));
}

/// It ended in std::invalid_argument or in a parser's words, without a file.
TEST(StudyTruth, ADamagedStudyIsRefusedWithItsFile) {
  const SmallStudy study(1);
  const std::string file = (study.folder() / "study.sqlite").string();
  const std::string deep = "UPDATE rubrics SET document='{\"stages\": " + std::string(100'000, '[') +
                           std::string(100'000, ']') + "}'";
  const std::pair<std::string, const char*> damages[] = {
      {"UPDATE study SET seed='many'", "its seed is 'many'"},
      {"UPDATE study SET seed='7 '", "its seed is '7 '"},
      {"UPDATE study SET seed='1'; UPDATE rubrics SET document='{'", "of task take is none"},
      {"UPDATE rubrics SET document='[]'", "of task take is none"},
      {"UPDATE rubrics SET document='{\"version\": 1}'", "of task take is none"},
      {"UPDATE rubrics SET document='{\"stages\": [7]}'", "of task take is none"},
      {deep, "of task take is none"},
      {"UPDATE rubrics SET document='{}'; DROP TRIGGER clips_hold; UPDATE clips SET views='[{'",
       "the views of clip 1 are none"}};
  for (const auto& [sql, what] : damages) {
    sqlite::Connection::OpenReadWrite(file).RunScript(sql);
    try {
      const StudyStore store = StudyStore::Open(study.folder(), StudyStore::Mode::kReadOnly);
      store.info(), store.Rubrics(), store.Clips();
      ADD_FAILURE() << sql.substr(0, 100);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr(file + ": the study is damaged"), HasSubstr(what))) << sql.substr(0, 100);
    }
  }
}

TEST(StudyTruth, VerdictsAndClipsCannotBeChangedOrDeleted) {
  SmallStudy study(2);
  StudyStore store = study.Open();
  RatingDesk desk(store, {});
  AtTheDesk ann(store, desk);
  ann.Say(ann.Next().body.at("presentation"), "success");
  sqlite::Connection raw = sqlite::Connection::OpenReadWrite(study.folder() / "study.sqlite");
  const std::pair<const char*, const char*> refusals[] = {{"UPDATE verdicts SET label='failure'", "never changed"},
                                                          {"DELETE FROM verdicts", "never deleted"},
                                                          {"UPDATE clips SET is_real=0", "a study is frozen"},
                                                          {"DELETE FROM clips", "a study is frozen"}};
  for (const auto& [sql, refusal] : refusals)
    EXPECT_THAT([&] { raw.RunScript(sql); }, testing::ThrowsMessage<Error>(HasSubstr(refusal))) << sql;
  EXPECT_EQ(store.VerdictTable().rows.size(), 1u);
}

}  // namespace
}  // namespace evac
