#include "reports/trust.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "reports/plan.h"
#include "reports/trust_output.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// One policy's outcomes in the states 0, 1, …: s, f, - none.
void Add(const std::string& policy, const std::string& outcomes, std::vector<TrialOutcome>& trials,
         std::uint64_t seed = 1) {
  for (std::size_t state = 0; state < outcomes.size(); ++state) {
    if (outcomes[state] != '-') trials.push_back({"take", policy, std::to_string(state), seed, outcomes[state] == 's'});
  }
}

std::string Times(int count, const std::string& text) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

TrustInput Input(const std::string& real, const std::string& model) {
  TrustInput input;
  Add("p", real, input.real);
  Add("p", model, input.model);
  return input;
}

TEST(TrustIn, AFaithfulModelIsTrustedOnceThereAreEnoughPairs) {
  const std::string outcomes = Times(30, "sf");
  EXPECT_EQ(TrustOf(Input(outcomes, outcomes))[0].trust, Trust::kYes);
  const TaskTrust few = TrustOf(Input("sfsf", "sfsf"))[0];
  EXPECT_EQ(few.trust, Trust::kUnknown);
  EXPECT_TRUE(few.more);
}

TEST(TrustIn, ABiasBesideTheMarginAsksForNoMorePairsThanAnyoneHas) {
  const TaskTrust task = TrustOf(Input(Times(5, "s") + Times(23, "f"), Times(5, "f") + "ss" + Times(21, "f")))[0];
  EXPECT_NEAR(*task.bias.value, -3. / 28, 1e-12);  // the margin is .1: 20 000 pairs
  EXPECT_EQ(task.trust, Trust::kUnknown);
  ASSERT_FALSE(task.more);
  EXPECT_THAT(task.more.reason(), HasSubstr("so near the margin that 10000 pairs would not do"));
}

/// Where all pairs flip one way no variance is seen: it asked for one more after one, two and three.
TEST(TrustIn, AModelThatIsAlwaysWrongIsFoundOutByAsManyPairsAsWereAskedFor) {
  for (int pairs = 1; pairs <= 4; ++pairs) {
    const TaskTrust few = TrustOf(Input(Times(pairs, "s"), Times(pairs, "f")))[0];
    EXPECT_EQ(few.trust, Trust::kUnknown) << pairs;
    ASSERT_TRUE(few.more) << pairs;
    EXPECT_EQ(*few.more, 5 - pairs);
    EXPECT_EQ(*TrustOf(Input(Times(pairs, "f"), Times(pairs, "s")))[0].more, 5 - pairs) << "the other way round";
  }
  EXPECT_EQ(TrustOf(Input("sssss", "fffff"))[0].trust, Trust::kNo);
}

TEST(TrustIn, AModelThatAlwaysSucceedsIsNot) {
  const TaskTrust task = TrustOf(Input(Times(15, "sf"), Times(30, "s")))[0];
  EXPECT_EQ(task.trust, Trust::kNo);
  EXPECT_NEAR(*task.bias.value, 0.5, 1e-12);
  EXPECT_LT(task.test.p_exact, 0.001);
  EXPECT_NEAR(*task.agreement.kappa.value, 0, 1e-12);
}

TEST(TrustIn, EqualRatesWithOtherStatesShowInKappaNotInTheBias) {
  const TaskTrust task = TrustOf(Input(Times(20, "sf"), Times(20, "fs")))[0];
  EXPECT_NEAR(*task.bias.value, 0, 1e-12);
  EXPECT_NEAR(*task.agreement.kappa.value, -1, 1e-12);
  EXPECT_EQ(task.trust, Trust::kUnknown);
}

TEST(TrustIn, FewerThanFourPoliciesGiveNoCorrelation) {
  TrustInput input;
  for (const auto& [policy, real, model] : {std::tuple{"a", "ssssssssss", "sssssssssf"},
                                            {"b", "sssssffffs", "ssssffffff"},
                                            {"c", "sfffffffff", "ssffffffff"}}) {
    Add(policy, real, input.real);
    Add(policy, model, input.model);
  }
  const TrustReport report{"sim", "the world real", "oracle", {}, TrustOf(input)};
  EXPECT_FALSE(report.tasks[0].correlation.value);
  EXPECT_THAT(TrustText(report), HasSubstr("over 3 policies it would mean nothing"));
  Add("d", "ffffffffff", input.real);
  Add("d", "ffffffffff", input.model);
  const TaskTrust four = TrustOf(input)[0];
  EXPECT_GT(*four.correlation.value, 0.9);
  EXPECT_TRUE(four.correlation.interval);
}

TEST(TrustIn, ReplicatesWithoutACorrelationAreCounted) {
  TrustInput input;
  for (const char* policy : {"a", "b", "c", "d"}) {
    const std::string outcomes = *policy == 'd' ? "sssssssfff" : "ssssssssss";
    Add(policy, outcomes, input.real);
    Add(policy, outcomes, input.model);
  }
  const TrustReport report{"sim", "the world real", "oracle", {}, TrustOf(input)};
  EXPECT_GT(report.tasks[0].undefined_replicates, 0) << "one draw in 35 holds no failure";
  EXPECT_THAT(TrustText(report), HasSubstr(" replicates without one dropped"));
  EXPECT_EQ(TrustJson(report).at("tasks").at(0).at("undefined_replicates"), report.tasks[0].undefined_replicates);
}

TEST(TrustIn, PoliciesThatShareStatesAreNotCountedAsIndependent) {
  TrustInput input;
  for (const char* policy : {"a", "b", "c", "d"}) {  // the model is wrong in the same states for all
    Add(policy, Times(5, "ssssf"), input.real);
    Add(policy, Times(5, "fsssf"), input.model);
  }
  const TaskTrust task = TrustOf(input)[0];
  EXPECT_EQ(task.pairs.n(), 100);
  EXPECT_THAT(task.bias.method, HasSubstr("effective pairs"));
  const TaskTrust alone = TrustOf(Input(Times(5, "ssssf"), Times(5, "fsssf")))[0];
  EXPECT_NEAR(task.bias.interval->high - task.bias.interval->low, alone.bias.interval->high - alone.bias.interval->low,
              0.03);
}

TEST(TrustIn, OneWrongOutcomeDoesNotMakeUnknownAYes) {
  TrustInput perfect;
  for (const char* policy : {"a", "b", "c"}) {
    Add(policy, Times(15, "sf"), perfect.real);
    Add(policy, Times(15, "sf"), perfect.model);
  }
  TrustInput one_wrong = perfect;
  one_wrong.model.back().success = !one_wrong.model.back().success;
  EXPECT_EQ(TrustOf(perfect)[0].trust, Trust::kUnknown) << "90 of 90 pairs agree, on 30 states";
  const TaskTrust task = TrustOf(one_wrong)[0];
  EXPECT_EQ(task.trust, Trust::kUnknown) << "89 of 90 said yes";
  EXPECT_EQ(task.effective_pairs, 36);
  EXPECT_THAT(task.bias.method, HasSubstr("Tango on 36 effective pairs"));
  EXPECT_EQ(*task.more, 14) << "35 states without a flip would do: 105 such pairs";
}

TEST(TrustIn, FewRealAndManyImaginedTrialsGiveOneRate) {
  TrustInput input;
  Add("p", Times(20, "ssf"), input.real);
  Add("p", Times(300, "ssf"), input.model);
  const PredictedRate rate = TrustOf(input)[0].policies[0];
  EXPECT_EQ(rate.pairs.n(), 60);
  EXPECT_EQ(rate.further.trials, 840);
  EXPECT_NEAR(*rate.predicted.value, 2.0 / 3, 1e-12);
  EXPECT_LT(rate.predicted.interval->high - rate.predicted.interval->low,
            rate.real.interval->high - rate.real.interval->low);
  EXPECT_FALSE(rate.tuned.allowed) << "the worlds never differ: PPI++'s interval would be a fairy tale";
}

/// The same outcomes with each of the seeds.
TrustInput WithSeeds(const std::string& real, const std::string& model, std::uint64_t seeds) {
  TrustInput input;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    Add("p", real, input.real, seed);
    Add("p", model, input.model, seed);
  }
  return input;
}

double Width(const Estimate& estimate) { return estimate.interval->high - estimate.interval->low; }

TEST(TrustIn, RepeatsOfOneStateDoNotMakeTheRealRateSurer) {
  const std::string real = Times(4, "ssf"), model = "sff" + Times(3, "ssf") + Times(100, "ssf");
  const TaskTrust once = TrustOf(WithSeeds(real, model, 1))[0], often = TrustOf(WithSeeds(real, model, 10))[0];
  const PredictedRate &one = once.policies[0], &ten = often.policies[0];
  EXPECT_EQ(ten.pairs.n(), 120);
  EXPECT_EQ(ten.further.trials, 3000) << "what was imagined, all of it";
  EXPECT_NEAR(*ten.predicted.value, *one.predicted.value, 1e-12);
  EXPECT_NEAR(Width(ten.predicted), Width(one.predicted), 0.05);
  EXPECT_THAT(ten.predicted.method, HasSubstr("on 11 effective pairs"));
  EXPECT_EQ(ten.betting.interval->low, one.betting.interval->low) << "bets are on one pair of each state";
  EXPECT_EQ(ten.betting.interval->high, one.betting.interval->high);
  EXPECT_FALSE(ten.tuned.allowed) << "120 pairs on 12 states are fewer than 40 real trials";
  EXPECT_NEAR(Width(often.real), Width(once.real), 1e-9);
  EXPECT_NEAR(Width(often.model), Width(once.model), 1e-9);
  EXPECT_NEAR(Width(often.same), Width(once.same), 1e-9);
}

TEST(TrustIn, ManyTrialsOnOneStateAreOnePair) {
  const TaskTrust task = TrustOf(WithSeeds("s", "s", 60))[0];
  EXPECT_EQ(task.effective_pairs, 1);
  EXPECT_EQ(task.trust, Trust::kUnknown);
  EXPECT_THAT(TrustText({"sim", "the world real", "oracle", {}, {task}}),
              HasSubstr("exact McNemar on 1 effective pair p = 1.00"));
}

TEST(TrustIn, ImportedTrialsArePairedByStateAndOwnEpisodesBySeed) {
  TrustInput input;
  Add("p", "ss", input.real, 1);
  Add("p", "ff", input.real, 2);
  Add("p", "ss", input.model, 41);
  input.seeds_agree = true;
  EXPECT_EQ(TrustOf(input)[0].pairs.n(), 0);
  input.seeds_agree = false;
  const TaskTrust task = TrustOf(input)[0];
  EXPECT_EQ(task.pairs.both, 2);
  EXPECT_EQ(task.policies[0].real_alone, 2) << "the second trial of each state has no partner";
}

TEST(TrustIn, NothingToHoldAgainstIsRefused) {
  TrustInput input;
  EXPECT_THROW(TrustOf(input), Error);
  EXPECT_THROW(TrustOf(Input("ss", "")), Error);
  EXPECT_THROW(TrustOf(Input("ss", "ss"), {.margin = 0}), Error);
}

TEST(TrustIn, ARunIsHeldAgainstItsRealWorldOrAgainstImportedTrials) {
  const SampleRun run({{"take", "p", "c", "ssssf", "ssfsfsss"}});
  const RunSummary summary = run.Summary();
  const TrustInput own = TrustInputOf(summary, {}, "sim");
  EXPECT_EQ(own.real.size(), 5u);
  EXPECT_EQ(own.model.size(), 8u);
  RealTrial trial{"take", "41-0000", "p", "c", 1, Label::kSuccess, "", "t.csv:2"}, unclear = trial;
  unclear.outcome = Label::kCannotTell;
  unclear.trial = 2;
  const TrustInput imported = TrustInputOf(summary, {trial, unclear}, "sim");
  EXPECT_EQ(imported.real.size(), 1u) << "the run's own real world no longer counts";
  EXPECT_FALSE(imported.seeds_agree);
  EXPECT_THROW(TrustInputOf(summary, {}, "reel"), Error);
  EXPECT_THROW(TrustInputOf(summary, {}, "real"), Error);
}

TEST(TrustOutput, JsonHoldsEveryNumberWithItsReason) {
  const TrustReport report{"sim", "the world real", "oracle", {}, TrustOf(Input("sfsfsfsfsf", "sfsfsfsfss"))};
  const auto task = TrustJson(report).at("tasks").at(0);
  EXPECT_EQ(task.at("trust"), "unknown");
  EXPECT_EQ(task.at("pairs").at("model_only"), 1);
  EXPECT_TRUE(task.at("pearson").at("value").is_null());
  EXPECT_TRUE(task.at("policies").at(0).at("predicted").contains("value_reason"));
  const TrustReport unpaired{"sim", "the world real", "oracle", {}, TrustOf(Input("sf--", "--sf"))};
  const auto none = TrustJson(unpaired).at("tasks").at(0);
  EXPECT_TRUE(none.at("mcnemar_p_exact").is_null());
  EXPECT_EQ(none.value("mcnemar_p_exact_reason", ""), "no pairs");
}

TEST(TrustOutput, NoShareIsAboveAHundredPercent) {
  // 6 succeed in both, 2 only for real, 1 in neither, and all 14 further ones in the model: 102 % by the formula.
  const TrustReport report{"sim", "the world real", "oracle", {},
                           TrustOf(Input("ssssssssf", "ssssssfff" + Times(14, "s")))};
  EXPECT_GT(*report.tasks[0].policies[0].tuned.value, 1);
  EXPECT_THAT(TrustText(report), HasSubstr("100 % (weight "));
  const auto policy = TrustJson(report).at("tasks").at(0).at("policies").at(0);
  EXPECT_EQ(policy.at("ppi_plus_plus"), 1);
  for (const char* rate : {"real", "model", "predicted", "predicted_by_betting"})
    EXPECT_LE(policy.at(rate).at("value").get<double>(), 1) << rate;
}

TEST(TrustOutput, ABiasThatRoundsToNothingHasNoMinus) {
  const std::string all = Times(400, "s");
  const TrustReport report{"sim", "the world real", "oracle", {}, TrustOf(Input(all, "f" + all.substr(1)))};
  EXPECT_LT(*report.tasks[0].bias.value, 0);
  EXPECT_THAT(TrustText(report), HasSubstr("bias +0 points [")) << "it was -0";
}

/// "Within ±12 points" of 0.125, "±0 points" of 0.005.
TEST(TrustOutput, AMarginIsSaidAsItWasGiven) {
  const auto text = [](double margin) {
    TrustReport report{"sim", "the world real", "oracle", {}, TrustOf(Input("sfsf", "sfsf"))};
    report.options.margin = margin;
    report.tasks.at(0).trust = Trust::kYes;
    return TrustText(report);
  };
  EXPECT_THAT(text(0.125), HasSubstr("±12.5 points"));
  EXPECT_THAT(text(0.005), HasSubstr("±0.5 points"));
  EXPECT_THAT(text(0.07), HasSubstr("±7 points"));
}

TEST(PlanFor, AMarginAndADifferenceAreSaidAsTheyWereGiven) {
  const std::string text = PlanText(MakePlan({.difference = 0.075, .margin = 0.125}));
  EXPECT_THAT(text, HasSubstr("To see a difference of 7.5 points with "));
  EXPECT_THAT(text, HasSubstr("to show \"not worse by 12.5 points\""));
  EXPECT_THAT(text, HasSubstr("episodes for ± 5 points at that rate"));
}

/// "The 1 states at hand", "from 1 episodes".
TEST(PlanFor, OneIsSaidInTheSingular) {
  const std::string text = PlanText(MakePlan({.trials = 1}));
  EXPECT_THAT(text, HasSubstr("The 1 state at hand sees it with a chance of"));
  EXPECT_THAT(text, HasSubstr("from 1 episode"));
  for (const char* plural : {"1 states", "1 episodes"}) EXPECT_THAT(text, testing::Not(HasSubstr(plural))) << plural;
}

TEST(PlanFor, RatesAndOtherSharesAreSaidAsTheyWereGiven) {
  const std::string text = PlanText(MakePlan({.rate = 0.125, .difference = 0.075, .flips = 0.105, .correlation = 0.999,
                                              .accuracy = 0.925, .wanted_right = 0.995, .promise = {.power = 0.825}}));
  EXPECT_THAT(text, HasSubstr("interval of a rate of 12.5 % from"));
  EXPECT_THAT(text, HasSubstr("to see 20 % against 12.5 %, same states, 10.5 % of them flip"));
  EXPECT_THAT(text, HasSubstr("raters, each 92.5 % right, for a majority 99.5 % right"));
  EXPECT_THAT(text, HasSubstr("a difference of 7.5 points with 82.5 % power"));
  EXPECT_THAT(text, HasSubstr("To tell a correlation of 0.999 from 0"));
}

TEST(PlanFor, AnswersInWordsAndATableForTheUsersNumbers) {
  const Plan plan = MakePlan({.rate = 0.28, .difference = 0.08, .trials = 25});
  EXPECT_THAT(PlanText(plan), HasSubstr("it takes 533 episodes of each"));
  const auto json = PlanJson(plan);
  EXPECT_EQ(json.at("rows").at(0).at("key"), "interval_half_width");
  EXPECT_EQ(json.at("rows").size(), plan.rows.size());
  for (const PlanRow& row : plan.rows) EXPECT_FALSE(row.shown.empty()) << row.key;
}

TEST(PlanFor, ByDefaultNoMoreStatesFlipThanTheTwoRatesLeaveRoomFor) {
  const Plan plan = MakePlan({.rate = 0.9});  // the other always succeeds, and loses no state
  EXPECT_NEAR(*plan.options.flips, 0.1, 1e-12);
  const auto value = [&](const std::string& key) { return *std::ranges::find(plan.rows, key, &PlanRow::key)->value; };
  EXPECT_EQ(value("paired_states"), 78) << "it was 168";
  EXPECT_NEAR(value("paired_power"), 0.206, 0.001);
  EXPECT_EQ(*MakePlan({}).options.flips, 0.2);
  EXPECT_EQ(*MakePlan({.difference = 0.3}).options.flips, 0.3) << "fewer make no such difference";
  EXPECT_EQ(*MakePlan({.rate = 0.9, .flips = 0.1}).options.flips, 0.1);
  const auto message = [](const PlanOptions& options) -> std::string {
    try {
      MakePlan(options);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_EQ(message({.rate = 0.9, .flips = 0.15}),
            "plan: --flips is 0.15, wanted at most 0.1: of 100 % against 90 % no more can differ");
  EXPECT_EQ(message({.rate = 0.5, .difference = 0.6, .flips = 0.7}),
            "plan: --difference is 0.6, wanted at most 0.5, as far as a rate can be from 0.5");
}

TEST(PlanFor, NotWorseByTakesNoFewerThanShowItWhereNothingDiffers) {
  const Plan plan = MakePlan({.rate = 0.99, .difference = 0.01});
  for (const char* key : {"non_inferiority_pairs", "non_inferiority_episodes"})
    EXPECT_EQ(*std::ranges::find(plan.rows, key, &PlanRow::key)->value, 25) << key << ": it was 7 and 13";
}

/// "Will not be told from 0": they are, in fewer than 80 of 100 cases.
TEST(PlanFor, ASizeIsThatOfItsPowerAndNoWallBelowIt) {
  EXPECT_EQ(MakePlan({}).words.back(),
            "To tell a correlation of 0.90 from 0 with 80 % power takes 7 policies; fewer see it less often.");
  EXPECT_THAT(PlanText(MakePlan({.correlation = 1e-12})), testing::Not(HasSubstr("takes undefined")));
}

TEST(PlanFor, AModelThatNeverAgreesIsPlannedForToo) {
  for (const double rate : {0.25, 0.5, 0.75, 0.05}) EXPECT_FALSE(MakePlan({.rate = rate, .agreement = 0}).rows.empty());
}

TEST(PlanFor, WhatCannotBeIsRefusedAndWhatCannotBeKnownIsUndefined) {
  EXPECT_THROW(MakePlan({.rate = 1.2}), Error);
  EXPECT_THROW(MakePlan({.difference = 0.3, .flips = 0.1}), Error);
  EXPECT_THROW(MakePlan({.accuracy = 0.5}), Error);
  EXPECT_THROW(MakePlan({.promise = {.alpha = 0}}), Error);
  const Plan plan = MakePlan({.imagined = 0});
  EXPECT_THAT(PlanText(plan), HasSubstr("undefined: no further model outcomes"));
}

}  // namespace
}  // namespace evac
