#include "judges/rating_votes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/statistics/rater_agreement.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr Vote S = Vote::kSuccess, F = Vote::kFailure, U = Vote::kUnsure;

TEST(Resolve, AStrictMajorityOfThoseWhoCouldTell) {
  EXPECT_EQ(Resolve({S, S, F}, std::nullopt, 2).label, Label::kSuccess);
  EXPECT_EQ(Resolve({S, F, F}, std::nullopt, 2).label, Label::kFailure);
  EXPECT_EQ(Resolve({S, S, U}, std::nullopt, 2).label, Label::kSuccess);
  EXPECT_EQ(Resolve({S, F, U}, std::nullopt, 2).how, "tie");
  EXPECT_EQ(Resolve({S, U, U}, std::nullopt, 2).how, "too few votes");
  EXPECT_EQ(Resolve({}, std::nullopt, 2).how, "not rated");
  EXPECT_FALSE(Resolve({S, F}, std::nullopt, 2).label);
  EXPECT_EQ(Resolve({S}, std::nullopt, 1).label, Label::kSuccess);
}

TEST(Resolve, TheAdjudicatorsWordIsTheLast) {
  EXPECT_EQ(Resolve({S, S, S}, "failure", 2).label, Label::kFailure);
  EXPECT_EQ(Resolve({S, F}, "success", 2).how, "adjudicated");
  EXPECT_FALSE(Resolve({S, S, S}, "cannot_tell", 2).label) << "never a failure by default";
}

RatedClip Rated(const std::vector<std::string>& labels) {
  RatedClip clip;
  std::vector<Vote> votes;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    clip.by_rater[static_cast<std::int64_t>(i)].label = labels[i];
    votes.push_back(labels[i] == "success" ? S : labels[i] == "failure" ? F : U);
  }
  clip.resolution = Resolve(votes, std::nullopt, 2);
  return clip;
}

TEST(Rates, UndecidedClipsAreBoundsNotFailures) {
  const std::vector<RatedClip> clips = {
      Rated({"success", "success", "success"}), Rated({"failure", "failure", "failure"}),
      Rated({"success", "failure", "cannot_tell"}), Rated({"success", "success", "failure"})};
  const LabelRates rates = RatesOf(clips);
  EXPECT_EQ(rates.decided, 3);
  EXPECT_EQ(rates.undecided, 1);
  EXPECT_NEAR(*rates.majority, 2.0 / 3, 1e-12);
  EXPECT_NEAR(*rates.low, 0.5, 1e-12);
  EXPECT_NEAR(*rates.high, 0.75, 1e-12);
  EXPECT_NEAR(*rates.unanimous, 0.5, 1e-12);
  EXPECT_NEAR(*rates.soft, (1 + 0 + 0.5 + 2.0 / 3) / 4, 1e-12);
  EXPECT_TRUE(rates.far_apart);
}

TEST(Rates, DawidAndSkeneSayNothingOfClipsWithOneVoteEach) {
  std::vector<RatedClip> clips(6, Rated({"success"}));
  clips.resize(10, Rated({"failure"}));
  clips.push_back(Rated({"success", "cannot_tell"}));
  for (RatedClip& clip : clips) clip.resolution.label = Label::kSuccess;  // as majority of one, or by an adjudicator
  for (std::size_t i = 6; i < 10; ++i) clips[i].resolution.label = Label::kFailure;
  const LabelRates rates = RatesOf(clips);
  EXPECT_FALSE(rates.dawid_skene);
  EXPECT_EQ(rates.dawid_skene.reason(), "no clip has two votes");
  EXPECT_NEAR(*rates.majority, 7.0 / 11, 1e-12);
  EXPECT_NEAR(*rates.soft, 7.0 / 11, 1e-12);
  clips.pop_back();
  EXPECT_FALSE(RatesOf(clips).far_apart) << "three rates of one and the same votes";
  clips.push_back(Rated({"success", "success"}));
  EXPECT_TRUE(RatesOf(clips).dawid_skene);
  EXPECT_EQ(RatesOf(std::vector{Rated({"cannot_tell"})}).dawid_skene.reason(), "no votes");
}

TEST(Agreement, RawAgreementStaysHighWhereKappaFalls) {
  std::vector<RatedClip> clips(19, Rated({"success", "success", "success"}));
  clips.push_back(Rated({"success", "success", "failure"}));
  const RatingAgreement agreement = RatersAgreement(clips, 3);
  EXPECT_NEAR(*agreement.agreement, 58.0 / 60, 1e-12);
  EXPECT_NEAR(*agreement.fleiss, -0.017, 5e-4);
  ASSERT_TRUE(agreement.interval);
  EXPECT_LE(agreement.interval->low, *agreement.alpha);
  EXPECT_GE(agreement.interval->high, *agreement.alpha);
  EXPECT_GT(agreement.dropped_replicates, 40) << "a third of 200 draws hold the one split clip not once";
  EXPECT_LT(agreement.dropped_replicates, 110);
}

TEST(Agreement, AlphaIsKrippendorffsAlsoWhereRatersSawDifferentClips) {
  const std::vector<std::map<std::int64_t, std::string>> votes = {{{1, "success"}, {2, "success"}, {3, "failure"}},
                                                                  {{2, "failure"}, {4, "failure"}},
                                                                  {{1, "cannot_tell"}, {3, "failure"}, {4, "failure"}},
                                                                  {{5, "success"}},
                                                                  {{2, "success"}, {5, "success"}}};
  const std::map<std::string, double> category = {{"failure", 0}, {"success", 1}, {"cannot_tell", 2}};
  std::vector<RatedClip> clips;
  std::vector<std::vector<std::optional<double>>> ratings(5, std::vector<std::optional<double>>(votes.size()));
  for (const auto& of_clip : votes) {
    RatedClip& clip = clips.emplace_back();
    for (const auto& [rater, label] : of_clip) {
      clip.by_rater[rater].label = label;
      ratings[static_cast<std::size_t>(rater - 1)][clips.size() - 1] = category.at(label);
    }
  }
  const RatingAgreement agreement = RatersAgreement(clips, 3);
  EXPECT_NEAR(*agreement.alpha, *KrippendorffAlpha(ratings, RatingMetric::kNominal), 1e-12);
  EXPECT_EQ(agreement.clips, 4);
  EXPECT_EQ(RatersAgreement({Rated({"success", "success"})}, 3).alpha.reason(), "all ratings are equal");
}

TEST(Quality, FastHandsAndOneAnswerAreSaidAloud) {
  StudyClip clip;
  clip.id = 1;
  clip.frames = 100;
  const std::unordered_map<std::int64_t, StudyClip> clips = {{1, clip}};
  std::vector<StudyStore::Ballot> ballots(30,
                                          {.rater = 1, .clip = 1, .label = "success", .rt_ms = 9000, .max_speed = 1});
  EXPECT_THAT(QualityOfRater(ballots, clips, 0.1).concerns, ElementsAre(HasSubstr("all 30 verdicts are success")));
  ballots[0].label = "failure";
  EXPECT_THAT(QualityOfRater(ballots, clips, 0.1).concerns, IsEmpty());
  ballots[1].rt_ms = 2400;
  EXPECT_THAT(QualityOfRater(ballots, clips, 0.1).concerns, IsEmpty()) << "one of thirty is below 5 %";
  ballots[2].rt_ms = 2400;
  EXPECT_THAT(QualityOfRater(ballots, clips, 0.1).concerns, ElementsAre(HasSubstr("2 of 30 verdicts came too fast")));
  ballots[1].max_speed = ballots[2].max_speed = 2;
  EXPECT_THAT(QualityOfRater(ballots, clips, 0.1).concerns, IsEmpty()) << "at twice the speed half the time is enough";
}

TEST(Quality, KnownClipsAndRepeatsAreCounted) {
  StudyClip clip;
  clip.id = 1;
  clip.frames = 10;
  clip.reference = Label::kFailure;
  const std::unordered_map<std::int64_t, StudyClip> clips = {{1, clip}};
  const RaterQuality quality =
      QualityOfRater({{.rater = 1, .clip = 1, .label = "failure", .showing = Showing::kGold, .rt_ms = 5000},
                      {.rater = 1, .clip = 1, .label = "success", .showing = Showing::kRepeat, .rt_ms = 5000}},
                     clips, 0.1);
  EXPECT_EQ(quality.gold_seen, 1);
  EXPECT_EQ(quality.gold_right, 1);
  EXPECT_EQ(quality.repeats_seen, 1);
  EXPECT_EQ(quality.repeats_same, 0);
}

TEST(Quality, ImportedVerdictsHaveNoTime) {
  const std::unordered_map<std::int64_t, StudyClip> clips = {{1, StudyClip()}, {2, StudyClip()}};
  std::vector<StudyStore::Ballot> ballots = {
      {.rater = 1, .clip = 1, .label = "success", .showing = Showing::kImport}};
  EXPECT_FALSE(QualityOfRater(ballots, clips, 0.1).median_rt_ms);
  ballots.push_back({.rater = 1, .clip = 2, .label = "success", .rt_ms = 5000});
  EXPECT_EQ(QualityOfRater(ballots, clips, 0.1).median_rt_ms, 5000);
}

TEST(Quality, AFirstAnswerThatWasChangedAfterItsRepeatIsComparedAllTheSame) {
  const std::unordered_map<std::int64_t, StudyClip> clips = {{1, StudyClip()}, {2, StudyClip()}};
  const std::vector<StudyStore::Ballot> ballots = {
      {.id = 2, .rater = 1, .clip = 1, .label = "success", .showing = Showing::kRepeat, .rt_ms = 5000},
      {.id = 3, .supersedes = 1, .rater = 1, .clip = 1, .label = "success", .rt_ms = 5000},
      {.id = 4, .rater = 1, .clip = 2, .label = "success", .showing = Showing::kRepeat, .rt_ms = 5000}};
  const RaterQuality quality = QualityOfRater(ballots, clips, 0.1);
  EXPECT_EQ(quality.repeats_seen, 1) << "of the other clip the first answer was undone: nothing to compare with";
  EXPECT_EQ(quality.repeats_same, 1);
  EXPECT_EQ(quality.verdicts, 3);
}

}  // namespace
}  // namespace evac
