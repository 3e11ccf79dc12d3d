#include "reports/policy_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/statistics/planning.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/stratified.h"
#include "core/statistics/two_by_two.h"
#include "reports/policy_comparison_output.h"
#include "reports/wording.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// Outcomes of one task in the states 0, 1, …: s success, f failure, e error, - no such episode.
void Add(const std::string& task, const std::string& outcomes, ComparedPolicy& policy, std::uint64_t seed = 1) {
  for (std::size_t state = 0; state < outcomes.size(); ++state) {
    if (outcomes[state] == '-') continue;
    JudgedEpisode judged;
    judged.episode.key.pair = {task, std::to_string(state), "p", "c", seed};
    judged.outcome = outcomes[state] == 's'   ? Outcome::kSuccess
                     : outcomes[state] == 'f' ? Outcome::kFailure
                                              : Outcome::kError;
    policy.episodes.push_back(judged);
  }
}

ComparedPolicy Policy(const std::string& name, const std::string& outcomes, const std::string& task = "take") {
  ComparedPolicy policy{name, {}};
  Add(task, outcomes, policy);
  return policy;
}

std::string Times(int count, const std::string& text) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

TEST(ComparePolicies, OnSharedStatesTheFlipsDecide) {
  const PolicyComparison comparison =
      ComparePolicies(Policy("good", Times(12, "s") + "ffff"), Policy("bad", Times(4, "s") + Times(12, "f")));
  ASSERT_EQ(comparison.tasks.size(), 1u);
  const ComparisonRow& row = comparison.tasks[0];
  EXPECT_TRUE(row.is_paired);
  EXPECT_EQ(row.shared, 16);
  EXPECT_EQ(row.flips.only_first, 8);
  EXPECT_EQ(row.flips.only_second, 0);
  EXPECT_NEAR(*row.p, 2.0 / 256, 1e-12);
  EXPECT_EQ(row.winner, Winner::kFirst);
  EXPECT_EQ(comparison.all.winner, Winner::kFirst);
  EXPECT_THAT(DecisionOf(comparison), HasSubstr("good is better than bad: 75 % against 25 %, +50 points"));
}

TEST(ComparePolicies, TheLoserIsNamedFromBothSides) {
  const ComparedPolicy good = Policy("good", Times(10, "s")), bad = Policy("bad", Times(10, "f"));
  EXPECT_EQ(ComparePolicies(good, bad).all.winner, Winner::kFirst);
  EXPECT_EQ(ComparePolicies(bad, good).all.winner, Winner::kSecond);
}

TEST(ComparePolicies, WhatIsNotDecidedSaysHowManyMorePairsWould) {
  const PolicyComparison comparison = ComparePolicies(Policy("a", "ssssffffss"), Policy("b", "sfsfffffss"));
  const ComparisonRow& row = comparison.all;
  EXPECT_EQ(row.winner, Winner::kNotDecided);
  ASSERT_TRUE(row.more);
  const FlipRates rates{2.5 / 11, 0.5 / 11};
  EXPECT_GE(McNemarPower(row.shared + *row.more, rates), 0.8);
  EXPECT_LT(McNemarPower(row.shared + *row.more - 1, rates), 0.8);
  const PolicyComparison equal = ComparePolicies(Policy("a", "ssff"), Policy("b", "ssff"));
  EXPECT_FALSE(equal.all.more);
  EXPECT_THAT(DecisionOf(equal), HasSubstr("No number of further episodes can be named: no pair differs"));
}

TEST(ComparePolicies, ADifferenceThatRoundsToNothingHasNoMinus) {
  PolicyComparison comparison = ComparePolicies(Policy("a", "ssffss"), Policy("b", "sfsfss"));
  comparison.all.difference.value = -0.003;
  comparison.all.difference.interval = Interval{-0.032, -0.004};
  EXPECT_THAT(DecisionOf(comparison), HasSubstr("+0 points [-3, +0]")) << "it was -0";
  EXPECT_EQ(SignedPoints(0.3), "+30");
}

TEST(ComparePolicies, BelowEightyPercentSharedStatesTheTwoAreNotPaired) {
  const ComparedPolicy one = Policy("a", "ssssssffff");
  EXPECT_TRUE(ComparePolicies(one, Policy("b", "--ssffffff")).all.is_paired);
  const ComparisonRow row = ComparePolicies(one, Policy("b", "---sffffff")).all;
  EXPECT_FALSE(row.is_paired);
  EXPECT_EQ(row.test, "Boschloo");
  EXPECT_EQ(row.first_episodes, 10);
  EXPECT_EQ(row.second_episodes, 7);
  EXPECT_EQ(row.difference.method, "Newcombe");
}

TEST(ComparePolicies, SeveralTasksAreAdjustedForEachAndStratifiedTogether) {
  ComparedPolicy one{"a", {}}, two{"b", {}};
  Add("t1", Times(8, "s"), one);
  Add("t1", "ssffffff", two);
  Add("t2", Times(8, "s"), one);
  Add("t2", "ssffffff", two);
  const PolicyComparison paired = ComparePolicies(one, two);
  ASSERT_EQ(paired.tasks.size(), 2u);
  EXPECT_NEAR(*paired.tasks[0].p, 0.03125, 1e-12);
  EXPECT_NEAR(*paired.tasks[0].p_holm, 0.0625, 1e-12) << "two tasks are on the page";
  EXPECT_EQ(paired.tasks[0].winner, Winner::kNotDecided);
  EXPECT_EQ(paired.all.shared, 16) << "states of one name in two tasks are two states";
  EXPECT_EQ(paired.all.winner, Winner::kFirst);

  ComparedPolicy elsewhere{"c", {}};
  Add("t1", Times(8, "-") + "ssffffff", elsewhere);
  Add("t2", Times(8, "-") + "ssffffff", elsewhere);
  const ComparisonRow pooled = ComparePolicies(one, elsewhere).all;
  EXPECT_EQ(pooled.test, "Cochran-Mantel-Haenszel");
  EXPECT_NEAR(*pooled.difference.value, 0.75, 1e-12);
}

TEST(ComparePolicies, RepeatsOfOneStateDoNotCountAsNewStates) {
  ComparedPolicy one{"a", {}}, two{"b", {}};
  for (std::uint64_t seed = 0; seed < 10; ++seed) {  // always the same outcome: ten times the same four states
    Add("t", "sssf", one, seed);
    Add("t", "sfff", two, seed);
  }
  const ComparisonRow row = ComparePolicies(one, two).all;
  EXPECT_EQ(row.shared, 40);
  EXPECT_EQ(row.flips.only_first, 20);
  EXPECT_NEAR(*row.difference.value, 0.5, 1e-12);
  EXPECT_THAT(row.test, HasSubstr("effective pairs"));
  EXPECT_GT(*row.p, 0.05) << "two states of four flipped, whatever the number of seeds";
}

/// The same outcomes with ten seeds.
ComparedPolicy TenTimes(const std::string& name, const std::vector<std::pair<std::string, std::string>>& tasks) {
  ComparedPolicy policy{name, {}};
  for (const auto& [task, outcomes] : tasks) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) Add(task, outcomes, policy, seed);
  }
  return policy;
}

TEST(ComparePolicies, RepeatsOfOneStateDoNotCountAsNewStatesUnpairedEither) {
  const ComparisonRow row = ComparePolicies(TenTimes("a", {{"t", "ss"}}), TenTimes("b", {{"t", "--ff"}})).all;
  EXPECT_FALSE(row.is_paired);
  EXPECT_EQ(row.first.n, 20);
  EXPECT_EQ(*row.difference.value, 1);
  EXPECT_EQ(row.difference.n, 40);
  EXPECT_EQ(row.test, "Boschloo on 2 and 2 effective episodes");
  EXPECT_EQ(row.difference.method, "Newcombe on 2 and 2 effective episodes");
  EXPECT_EQ(*row.p, BoschlooExact({2, 2}, {0, 2}).two_sided);
  EXPECT_EQ(row.difference.interval->low, NewcombeDifference({2, 2}, {0, 2}).interval->low);
}

TEST(ComparePolicies, MoreUnpairedEpisodesThanAnExactTestTakesAreComparedAllTheSame) {
  const std::string many = Times(1800, "s") + Times(1200, "f");
  const std::string others = Times(3000, "-") + Times(1155, "s") + Times(945, "f");
  ComparedPolicy one = Policy("a", many, "t"), two = Policy("b", others, "t");
  const ComparisonRow row = ComparePolicies(one, two).all;
  EXPECT_FALSE(row.is_paired);
  EXPECT_EQ(row.test, "Newcombe");
  EXPECT_EQ(row.winner, Winner::kFirst);
  EXPECT_NEAR(NewcombeDifference({1800, 3000}, {1155, 2100}, 1 - *row.p).interval->low, 0, 1e-9);

  Add("u", many, one);
  Add("u", others, two);
  const PolicyComparison both = ComparePolicies(one, two);
  EXPECT_EQ(both.tasks[0].test, "Newcombe");
  EXPECT_EQ(both.all.test, "Cochran-Mantel-Haenszel");
  EXPECT_EQ(both.all.first_trials.all, 6000);
  EXPECT_NEAR(*both.all.first.value, 0.6, 1e-12);
  EXPECT_NEAR(*both.all.difference.value, 0.05, 1e-12);
}

TEST(ComparePolicies, RepeatsOfOneStateDoNotFillStrata) {
  const ComparisonRow row = ComparePolicies(TenTimes("a", {{"t", "sss"}, {"u", "ssf"}}),
                                            TenTimes("b", {{"t", "---fff"}, {"u", "---sff"}})).all;
  EXPECT_EQ(row.test, "Cochran-Mantel-Haenszel on 6 and 6 effective episodes");
  const std::vector<Stratum> strata = {{{3, 3}, {0, 3}}, {{2, 3}, {1, 3}}};
  EXPECT_NEAR(*row.p, *MantelHaenszel(strata).p, 1e-12);
  EXPECT_NEAR(*row.difference.value, 2.0 / 3, 1e-12);
  EXPECT_EQ(row.first.n, 60);
}

TEST(ComparePolicies, TheDifferenceOfAllTasksIsOfAllTrialsAlsoWhereFewOfThemTell) {
  // Three repeats of one state a task, all alike but for one: one effective trial each, which is not 2 of 3 rounded.
  ComparedPolicy one{"a", {}}, two{"b", {}};
  const auto add = [](const std::string& task, const std::string& outcomes, bool other, ComparedPolicy& policy) {
    for (std::size_t seed = 0; seed < outcomes.size(); ++seed)
      Add(task, (other ? "-" : "") + outcomes.substr(seed, 1), policy, seed);
  };
  const std::vector<std::pair<std::string, std::string>> outcomes = {
      {"sss", "sss"}, {"sss", "sss"}, {"ssf", "sff"}, {"fff", "fff"}, {"fff", "fff"}};
  for (std::size_t task = 0; task < outcomes.size(); ++task) {
    add("t" + std::to_string(task), outcomes[task].first, false, one);
    add("t" + std::to_string(task), outcomes[task].second, true, two);
  }
  const ComparisonRow row = ComparePolicies(one, two).all;
  EXPECT_FALSE(row.is_paired);
  EXPECT_NEAR(*row.difference.value, 1.0 / 15, 1e-12);
}

TEST(ComparePolicies, ATaskThatOneOfThemNeverTriedIsInNoNumberOfAllTasks) {
  ComparedPolicy one = Policy("a", "ssssffff", "t"), two = Policy("b", "--------sfffffff", "t");
  Add("u", "ssffffff", one);
  Add("u", "--------ssssffff", two);
  Add("v", Times(20, "s") + "e", one);
  const PolicyComparison comparison = ComparePolicies(one, two);
  const ComparisonRow& all = comparison.all;
  EXPECT_EQ(comparison.left_out, std::vector<std::string>{"v"});
  EXPECT_EQ(all.first_episodes, 16);
  EXPECT_EQ(*all.first.value, 6.0 / 16);
  EXPECT_EQ(*all.second.value, 5.0 / 16);
  EXPECT_NEAR(*all.difference.value, 1.0 / 16, 1e-12);
  EXPECT_EQ(all.first_apart, 1) << "what went wrong is told of every task";
  const ComparedWorld compared{"sim", "oracle", comparison, {}, {}};
  EXPECT_THAT(ComparisonText(compared), HasSubstr("Not in all tasks, for want of episodes of both that count: v."));
  EXPECT_EQ(ComparisonJson(compared).at("all_tasks").at("left_out").at(0), "v");
}

TEST(ComparePolicies, WhereNoTaskIsOfBothNothingIsCompared) {
  const PolicyComparison comparison = ComparePolicies(Policy("a", "ssss", "t"), Policy("b", "ffff", "u"));
  EXPECT_FALSE(comparison.all.p) << "a rate of one task is not held against one of another";
  EXPECT_FALSE(comparison.all.difference.value);
  EXPECT_EQ(comparison.left_out.size(), 2u);
  EXPECT_THAT(DecisionOf(comparison), HasSubstr("Nothing to compare a and b by"));
}

TEST(ComparePolicies, WhatIsNamedDecidesOverTasksToo) {
  const std::string better = Times(6, "s") + Times(4, "f"), worse = Times(5, "s") + Times(5, "f");
  const auto compare = [&](int times) {
    ComparedPolicy one{"a", {}}, two{"b", {}};
    for (const char* task : {"t", "u"}) {
      Add(task, Times(times, better), one);
      Add(task, std::string(static_cast<std::size_t>(10 * times), '-') + Times(times, worse), two);
    }
    return ComparePolicies(one, two).all;
  };
  const ComparisonRow row = compare(1);
  ASSERT_TRUE(row.more);
  const int times = static_cast<int>((20 + *row.more) / 20);
  EXPECT_GT(*compare(times / 3).p, 0.05);
  EXPECT_LT(*compare(times + 1).p, 0.05 / 2) << "as many have power to spare where the difference is as planned";
}

TEST(ComparePolicies, WhereBothAreAlikeInEveryTaskNoNumberOfEpisodesDecides) {
  ComparedPolicy one = Policy("a", "sss", "t"), two = Policy("b", "---ssss", "t");
  Add("u", "fff", one);
  Add("u", "---" + Times(20, "f"), two);
  const ComparisonRow row = ComparePolicies(one, two).all;
  EXPECT_EQ(*row.difference.value, 0);
  EXPECT_NE(*row.first.value, *row.second.value) << "of unlike numbers of easy and hard tasks";
  ASSERT_FALSE(row.more);
  EXPECT_EQ(row.more.reason(), "the two rates are equal");
}

/// About 10^32 more episodes were promised to tell .1 + .2 - .3 from 0, as what is left of them when cast to an integer.
TEST(ComparePolicies, ADifferenceThatIsNoneButForRoundingIsNone) {
  ComparedPolicy one = Policy("a", "sff", "t"), two = Policy("b", "---ssfffff", "t");
  Add("u", "ssf", one);
  Add("u", "---ssssfff", two);
  Add("v", "fff", one);
  Add("v", "---sffffff", two);
  const ComparisonRow row = ComparePolicies(one, two).all;
  EXPECT_NE(*row.difference.value, 0) << "or this looks at nothing";
  EXPECT_NEAR(*row.difference.value, 0, 1e-15);
  EXPECT_EQ(row.winner, Winner::kNotDecided);
  ASSERT_FALSE(row.more);
  EXPECT_EQ(row.more.reason(), "the two rates are equal");
}

TEST(ComparePolicies, HowManyMoreIsPlannedFromWhatRepeatsTell) {
  const ComparisonRow once = ComparePolicies(Policy("a", "sssssfff"), Policy("b", "sssfffff")).all;
  const ComparisonRow row =
      ComparePolicies(TenTimes("a", {{"t", "sssssfff"}}), TenTimes("b", {{"t", "sssfffff"}})).all;
  ASSERT_TRUE(once.more && row.more);
  EXPECT_EQ(row.shared, 80);
  const double n = static_cast<double>(row.pairs.effective), each = n / 80;
  const SampleSize size = PairsForMcNemar({(20 * each + 0.5) / (n + 1), 0.5 / (n + 1)});
  EXPECT_EQ(*row.more, *FurtherWanted(static_cast<double>(size.n), {80, row.pairs.effective}));
  EXPECT_GT(*row.more, 8 * *once.more) << "ten seeds each";

  const ComparisonRow apart = ComparePolicies(TenTimes("a", {{"t", "ssf"}}), TenTimes("b", {{"t", "---sff"}})).all;
  EXPECT_EQ(*apart.more, 10 * TrialsPerPolicy(2.0 / 3, 1.0 / 3).n - 30);
}

TEST(ComparePolicies, ATaskAmongSeveralIsPlannedAtItsShareOfAlpha) {
  ComparedPolicy one{"a", {}}, two{"b", {}};
  for (const char* task : {"t1", "t2"}) {
    Add(task, "ssssffffss", one);
    Add(task, "sfsfffffss", two);
  }
  const ComparisonRow row = ComparePolicies(one, two).tasks[0];
  ASSERT_TRUE(row.more);
  const FlipRates rates{2.5 / 11, 0.5 / 11};
  EXPECT_GE(McNemarPower(row.shared + *row.more, rates, 0.025), 0.8);
  EXPECT_LT(McNemarPower(row.shared + *row.more - 1, rates, 0.025), 0.8);
}

TEST(ComparePolicies, ErrorsAreInNoRateAndAreCounted) {
  const ComparisonRow row = ComparePolicies(Policy("a", "ssee"), Policy("b", "sfff")).all;
  EXPECT_EQ(row.first_apart, 2);
  EXPECT_EQ(row.first_episodes, 2);
  EXPECT_FALSE(row.is_paired) << "2 of 4 are shared";
}

TEST(ComparePolicies, WithoutEpisodesNothingIsSaid) {
  EXPECT_THROW(ComparePolicies({"a", {}}, {"b", {}}), Error);
  EXPECT_THROW(ComparePolicies(Policy("a", "s"), Policy("b", "s"), {.alpha = 0}), Error);
  const ComparisonRow row = ComparePolicies(Policy("a", "ss"), {"b", {}}).all;
  EXPECT_FALSE(row.p);
  EXPECT_EQ(row.winner, Winner::kNotDecided);
  EXPECT_FALSE(row.more);
}

TEST(ComparePoliciesOutput, TextAndJsonSayTheSame) {
  const ComparedWorld compared{"sim",
                               "oracle",
                               ComparePolicies(Policy("good", Times(12, "s") + "e"), Policy("bad", Times(13, "f"))),
                               {{"", 12, {12, 0}, 400, 500, 3}}};
  const std::string text = ComparisonText(compared);
  EXPECT_THAT(text, HasSubstr("World sim, judge oracle. good is better than bad"));
  EXPECT_THAT(text, HasSubstr("In no rate (errors, cannot tell, invalid, not judged): 1 of good, 0 of bad."));
  EXPECT_THAT(text, HasSubstr("different"));
  const auto json = ComparisonJson(compared);
  EXPECT_EQ(json.at("winner"), "first");
  EXPECT_EQ(json.at("all_tasks").at("flips").at("only_first"), 12);
  EXPECT_NEAR(json.at("sequential").at(0).at("p").get<double>(), 1 / 500.0, 1e-12);
}

}  // namespace
}  // namespace evac
