#include "judges/rating_tally.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>

#include "core/seed.h"
#include "judges/rating_board.h"
#include "tests/judges/rating_support.h"

namespace evac {
namespace {

/// Everything a board shows, as text: two that are equal were counted alike.
std::string Shown(const StudyStore& store, RatingTally& tally) { return RatingBoard(store, tally, 0).dump(); }

/// Raters and an adjudicator who do whatever may be done, in an order drawn by a seed.
class Crowd {
 public:
  Crowd(StudyStore& store, RatingDesk& desk, std::uint64_t seed) : store_(store), desk_(desk), draws_(seed) {
    for (int i = 0; i < 3; ++i) raters_.push_back(std::make_unique<AtTheDesk>(store, desk));
    judge_.emplace(store, desk, RaterRole::kAdjudicator);
  }

  void DoSomething() {
    AtTheDesk& rater = *raters_[draws_.Below(raters_.size())];
    switch (draws_.Below(8)) {
      case 0:
        return Undo(rater);
      case 1:
        return Replace(rater);
      case 2:
        return Adjudicate();
      default:
        return RateNext(rater);
    }
  }

  void SomebodyLeaves(bool keep) {
    store_.Withdraw(raters_.front()->id, keep, false, 0);
    raters_.erase(raters_.begin());
  }

 private:
  std::string Label() {
    constexpr const char* kLabels[] = {"success", "success", "failure", "cannot_tell"};
    return kLabels[draws_.Below(4)];
  }

  void RateNext(AtTheDesk& rater) {
    const DeskAnswer next = rater.Next();
    if (!next.body.contains("presentation")) return;
    HumanVerdict verdict = rater.Watched(next.body.at("presentation"), Label());
    if (draws_.Below(4) == 0) verdict.flags = "blur_hides";
    rater.Say(verdict);
  }

  std::optional<HumanVerdict> OneOf(const AtTheDesk& rater) {
    const auto said = store_.CurrentBy(rater.id);
    if (said.empty()) return std::nullopt;
    return said[draws_.Below(said.size())].verdict;
  }

  void Undo(AtTheDesk& rater) {
    if (const auto verdict = OneOf(rater))
      desk_.Retract(rater.Me(), {rater.epoch, NewSecret(), verdict->client_uuid}, 0);
  }

  void Replace(AtTheDesk& rater) {
    const auto old = OneOf(rater);
    if (!old) return;
    HumanVerdict verdict = rater.Watched(old->presentation, Label());
    verdict.supersedes = old->id;
    rater.Say(verdict);
  }

  void Adjudicate() {
    const DeskAnswer next = judge_->Next();
    if (!next.body.contains("presentation")) return;
    const std::string clip = next.body.at("presentation");
    judge_->Say(clip, Label());
    HumanVerdict last = judge_->Watched(clip, Label());
    last.supersedes = store_.CurrentVerdict(clip)->id;
    last.is_final = true;
    judge_->Say(last);
  }

  StudyStore& store_;
  RatingDesk& desk_;
  SplitMix64 draws_;
  std::vector<std::unique_ptr<AtTheDesk>> raters_;
  std::optional<AtTheDesk> judge_;
};

TEST(RatingTally, WhatWasReadBitByBitIsWhatIsReadAtOnce) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SmallStudy study(16, {.raters_per_clip = 2, .gold_from = "oracle"});
    StudyStore store = study.Open();
    RatingDesk desk(store, {});
    Crowd crowd(store, desk, seed);
    RatingTally tally;
    std::size_t most_disputes = 0;
    for (int step = 0; step < 160; ++step) {
      crowd.DoSomething();
      if (step == 80) crowd.SomebodyLeaves(seed == 2);
      if (step % 5 != 0) continue;
      RatingTally fresh;
      ASSERT_EQ(Shown(store, tally), Shown(store, fresh)) << "seed " << seed << ", step " << step;
      ASSERT_EQ(tally.Disputes(), store.Disputes()) << "seed " << seed << ", step " << step;
      most_disputes = std::max(most_disputes, tally.Disputes().size());
    }
    EXPECT_GT(most_disputes, 2u) << "nothing was disputed: the test tests nothing";
  }
}

TEST(RatingBoard, ThePaceIsOfVotesThatWereMissing) {
  constexpr std::int64_t kHour_ms = 3'600'000;
  SmallStudy study(16, {.raters_per_clip = 2, .gold_from = "oracle"});  // 12 clips and 8 gold
  StudyStore store = study.Open();
  RatingDesk desk(store, {});
  AtTheDesk ann(store, desk), bob(store, desk), eve(store, desk);
  const auto progress = [&](std::int64_t now_ms) { return RatingBoard(store, now_ms).at("progress"); };
  const auto label = [](const StudyClip&) { return "cannot_tell"; };
  EXPECT_GT(ann.RateAll(label), 28);
  EXPECT_EQ(progress(ann.now_ms).at("last_hour"), 20) << "neither practice nor repeats are votes";
  EXPECT_EQ(progress(ann.now_ms).at("hours_left"), 1);
  const std::vector<StudyStore::Said> said = store.CurrentBy(ann.id);
  const HumanVerdict vote = std::ranges::find(said, Showing::kCounted, &StudyStore::Said::showing)->verdict;
  HumanVerdict other = ann.Watched(vote.presentation, "failure");
  other.supersedes = vote.id;
  ann.now_ms += kHour_ms + 1;
  ASSERT_EQ(ann.Say(other).status, 200);
  EXPECT_EQ(progress(ann.now_ms).at("last_hour"), 0) << "what is said otherwise fills no place";
  EXPECT_TRUE(progress(ann.now_ms).at("hours_left").is_null());
  bob.now_ms = eve.now_ms = ann.now_ms;
  bob.RateAll(label);
  EXPECT_GE(eve.RateAll(label), 16) << "practice and gold are for everybody";
  EXPECT_EQ(progress(ann.now_ms).at("last_hour"), 20) << "a third vote fills no place";
  desk.Withdraw(bob.Me(), {.keep = false, .erase = false}, 9);
  EXPECT_EQ(progress(ann.now_ms).at("last_hour"), 8) << "votes that do not count are none; gold has eve's instead";
  EXPECT_EQ(progress(ann.now_ms).at("missing"), 12);
  EXPECT_EQ(progress(ann.now_ms).at("hours_left"), 1.5);
}

TEST(RatingTally, ACorrectedAnswerDidNotComeTooFastToHaveSeenTheClip) {
  SmallStudy study(4, {.raters_per_clip = 2});
  StudyStore store = study.Open();
  RatingDesk desk(store, {});
  AtTheDesk ann(store, desk);
  const std::string clip = ann.Next().body.at("presentation");
  HumanVerdict first = ann.Watched(clip, "success");
  first.max_speed = 2;
  ASSERT_EQ(ann.Say(first).status, 200);
  HumanVerdict other = ann.Watched(clip, "failure");
  other.supersedes = store.CurrentVerdict(clip)->id;
  other.rt_ms = 400;
  ASSERT_EQ(ann.Say(other).status, 200);
  const auto board = [&] { return RatingBoard(store, 0).at("raters").at(0); };
  EXPECT_TRUE(board().at("concerns").empty()) << board().at("concerns");
  EXPECT_EQ(board().at("median_rt_s"), 9);
  RatingTally tally;
  tally.Read(store);
  ASSERT_EQ(tally.By(ann.id).size(), 1u);
  EXPECT_EQ(tally.By(ann.id)[0].label, "failure");
  EXPECT_EQ(tally.By(ann.id)[0].max_speed, 2) << "a long clip at twice the speed takes half its time";
  EXPECT_EQ(store.CurrentVerdict(clip)->rt_ms, 400) << "what is stored is what the browser said";
  ASSERT_EQ(desk.Retract(ann.Me(), {ann.epoch, NewSecret(), other.client_uuid}, 0).status, 200);
  HumanVerdict hasty = ann.Watched(clip, "failure");
  hasty.rt_ms = 400;
  ASSERT_EQ(ann.Say(hasty).status, 200);
  EXPECT_EQ(board().at("concerns").size(), 1u) << "what was undone lends its time to nobody";
}

TEST(RatingTally, ClipsThatWereAddedAreThere) {
  SmallStudy study(4, {.raters_per_clip = 2});
  StudyStore store = study.Open();
  RatingTally tally;
  tally.Read(store);
  EXPECT_EQ(tally.rated().size(), 8u);
  study.run().Add("41-0004", 's', 'f');
  MakeStudy(study.folder(), {.runs = {study.run().folder()}, .raters_per_clip = 2, .height_px = 64},
            [](std::size_t, std::size_t) {});
  tally.Read(store);
  EXPECT_EQ(tally.rated().size(), 10u);
}

/// Both were given the same clips in step, and the later word silently won.
TEST(Adjudicators, WhoDecideAtOnceAreGivenDifferentClipsUntilOneAloneIsLeft) {
  SmallStudy study(2, {.raters_per_clip = 2});
  StudyStore store = study.Open();
  RatingDesk desk(store, {.min_repeats = 0});
  AtTheDesk ann(store, desk), bob(store, desk);
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip&) { return "failure"; });
  ASSERT_EQ(store.Disputes().size(), 4u);
  AtTheDesk eve(store, desk, RaterRole::kAdjudicator), fay(store, desk, RaterRole::kAdjudicator);
  const auto given = [&](AtTheDesk& who) {
    return store.FindPresentation(who.Next().body.at("presentation").get<std::string>())->clip;
  };
  const std::int64_t of_eve = given(eve), of_fay = given(fay);
  EXPECT_NE(of_eve, of_fay);
  EXPECT_EQ(given(eve), of_eve) << "a reload goes on there";
  EXPECT_EQ(given(fay), of_fay);
  for (int i = 0; i < 3; ++i) {
    const std::string clip = eve.Next().body.at("presentation");
    EXPECT_NE(store.FindPresentation(clip)->clip, of_fay);
    eve.Say(clip, "success");
    HumanVerdict last = eve.Watched(clip, "success");
    last.supersedes = store.CurrentVerdict(clip)->id;
    last.is_final = true;
    ASSERT_EQ(eve.Say(last).status, 200);
  }
  EXPECT_EQ(given(eve), of_fay) << "nothing else is left";
}

TEST(Adjudicators, AClipWhoseLeaseIsOverIsAnyonesAgain) {
  SmallStudy study(1, {.raters_per_clip = 2});
  StudyStore store = study.Open();
  RatingDesk desk(store, {.min_repeats = 0});
  AtTheDesk ann(store, desk), bob(store, desk);
  ann.RateAll([](const StudyClip&) { return "success"; });
  bob.RateAll([](const StudyClip&) { return "failure"; });
  AtTheDesk eve(store, desk, RaterRole::kAdjudicator), fay(store, desk, RaterRole::kAdjudicator);
  const auto given = [&](AtTheDesk& who) {
    return store.FindPresentation(who.Next().body.at("presentation").get<std::string>())->clip;
  };
  const std::int64_t first = given(eve);
  fay.now_ms += 600'001;
  EXPECT_EQ(given(fay), first);
  eve.now_ms = fay.now_ms;
  EXPECT_NE(given(eve), first) << "it is fay's by now";
}

}  // namespace
}  // namespace evac
