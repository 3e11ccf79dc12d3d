#include "reports/findings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/wording.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Finding FirstOf(const std::vector<SampleCell>& cells) { return FindingsOf(SampleRun(cells).Summary()).front(); }

TEST(Findings, AWorldThatFollowsIsSaidToFollowWithItsInterval) {
  const Finding finding = FindingsOf(LargeRun().Summary()).front();
  EXPECT_EQ(finding.decision, Decision::kYes);
  EXPECT_THAT(finding.answer, HasSubstr("sim follows real closely: Pearson 0.9"));
  EXPECT_THAT(finding.answer, HasSubstr("over 8 (task, policy) points"));
}

TEST(Findings, OfPairsThatEndOtherwiseItIsSaidWhichWay) {
  const std::vector<Finding> findings = FindingsOf(SampleRun({{"a", "pick", "1", "ssffff", "sfsfff"}}).Summary());
  EXPECT_THAT(findings.at(1).answer, AllOf(HasSubstr("4 of 6 pairs with the same initial state end alike"),
                                           HasSubstr("Hallucinated: of 4 that fail in real, 1 succeeds in"),
                                           HasSubstr("Missed: of 2 that succeed in real, 1 fails in")));
}

TEST(Findings, AnIntervalThatHoldsZeroIsNotDecided) {
  const Finding finding = FirstOf({{"a", "pick", "1", "sfsfs", "fsfff"},
                                   {"a", "pick", "2", "ssfff", "sfsfs"},
                                   {"a", "pick", "3", "sffff", "ssfff"},
                                   {"a", "pick", "4", "ffsfs", "fsfsf"}});
  EXPECT_EQ(finding.decision, Decision::kNotDecided);
  EXPECT_THAT(finding.answer, HasSubstr("holds 0"));
}

TEST(Findings, OneInitialStateDoesNotDecideWhetherAWorldFollows) {
  const Finding finding =
      FirstOf({{"a", "pick", "1", "s", "s"}, {"a", "pick", "2", "s", "s"}, {"a", "pick", "3", "f", "f"}});
  EXPECT_EQ(finding.decision, Decision::kNotDecided);
  EXPECT_THAT(finding.answer, HasSubstr("1 initial state of a task, wanted at least 2"));
}

/// The page said "sim follows real closely: Pearson 1.00 [1.00, 1.00]"; one replicate of three had no Pearson at all.
TEST(Findings, OneFailureInAllDoesNotDecideWhetherAWorldFollows) {
  const std::string all(20, 's'), one = std::string(19, 's') + "f";
  const Finding finding =
      FirstOf({{"a", "pick", "1", all, all}, {"a", "pick", "2", all, all}, {"a", "pick", "3", one, one}});
  EXPECT_EQ(finding.decision, Decision::kNotDecided);
  EXPECT_THAT(finding.answer, HasSubstr("of 2000 replicates have none: where they would lie nobody knows"));
}

TEST(Findings, TooFewPointsAreNotDecidedAndNoNumberIsGiven) {
  const Finding finding = FirstOf({{"a", "pick", "1", "ssf", "ssf"}, {"a", "pick", "2", "fff", "fff"}});
  EXPECT_EQ(finding.decision, Decision::kNotDecided);
  EXPECT_THAT(finding.answer, HasSubstr("undefined"));
  EXPECT_THAT(finding.answer, Not(HasSubstr("1.00")));
}

TEST(Findings, EqualRatesAreNotDecidedWithTheReason) {
  const Finding finding =
      FirstOf({{"a", "pick", "1", "ss", "sf"}, {"a", "pick", "2", "ss", "ff"}, {"a", "pick", "3", "ss", "ss"}});
  EXPECT_EQ(finding.decision, Decision::kNotDecided);
  EXPECT_THAT(finding.answer, HasSubstr("equal"));
}

TEST(Findings, AWorldThatTurnsTheOrderAroundIsSaidToRunAgainst) {
  const std::string all(12, 's'), none(12, 'f');
  const Finding finding = FirstOf({{"a", "pick", "1", all, none},
                                   {"a", "pick", "2", "ssssssffffff", "ssssssffffff"},
                                   {"a", "pick", "3", none, all}});
  EXPECT_EQ(finding.decision, Decision::kNo);
  EXPECT_THAT(finding.answer, HasSubstr("runs against"));
}

TEST(Findings, TheBestPolicyIsNamedOnlyWhereTheSharedStatesDecide) {
  const std::vector<Finding> clear = FindingsOf(
      SampleRun({{"a", "pick", "1", "ssssssssss", "ssssssssss"}, {"a", "pick", "2", "ffffffffff", "ffffffffff"}})
          .Summary());
  EXPECT_EQ(clear[2].decision, Decision::kYes);
  EXPECT_THAT(clear[2].answer, HasSubstr("pick@1 10/10"));
  EXPECT_THAT(clear[2].answer, HasSubstr("ahead of pick@2 0/10"));
  const std::vector<Finding> close =
      FindingsOf(SampleRun({{"a", "pick", "1", "sss", "sss"}, {"a", "pick", "2", "ssf", "ssf"}}).Summary());
  EXPECT_EQ(close[2].decision, Decision::kNotDecided);
  EXPECT_THAT(close[2].answer, HasSubstr("3 shared initial states"));
}

TEST(Findings, RepeatsOfOneStateDoNotDecideWhichPolicyIsBest) {
  const std::vector<Finding> findings =
      FindingsOf(RepeatedRun({{"a", "p", Alike(10, "ssss"), {}}, {"a", "q", Alike(10, "sfff"), {}}}));
  const Finding& best = findings.at(findings.size() - 2);
  EXPECT_EQ(best.decision, Decision::kNotDecided);
  EXPECT_THAT(best.answer, AllOf(HasSubstr("p@c 40/40"), HasSubstr("In 40 shared pairs, 30 to 0 where only one"),
                                 HasSubstr("exact McNemar on 3 effective pairs p = 0.50")));
}

TEST(Findings, WhatIsInNoRateIsSaid) {
  const Finding last = FindingsOf(SampleRun({{"a", "pick", "1", "see?", "ssuu"}}).Summary()).back();
  EXPECT_EQ(last.decision, Decision::kNo);
  EXPECT_EQ(last.answer, "3 of 8 episodes count. In no rate: 2 errors, 1 cannot tell, 2 not judged.");
}

TEST(Wording, NothingLooksMorePerfectThanItIs) {
  EXPECT_EQ(Plain(1), "1.00");
  EXPECT_EQ(Plain(0.9998), "0.999");
  EXPECT_EQ(Plain(-0.001), "0.00");
  EXPECT_EQ(Percent(0.999), "99.9 %");
  EXPECT_EQ(Percent(0.001), "0.1 %");
  EXPECT_EQ(Percent(0), "0 %");
  EXPECT_EQ(PValue(0.0001), "p < 0.001");
}

TEST(Wording, UndefinedIsAReasonAndNotADigit) {
  Estimate estimate;
  estimate.value = Undefined{"no trials"};
  EXPECT_EQ(PercentWithInterval(estimate), "undefined: no trials");
  EXPECT_EQ(NumberWithInterval(estimate), "undefined: no trials");
}

}  // namespace
}  // namespace evac
