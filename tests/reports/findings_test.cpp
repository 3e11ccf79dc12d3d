#include "reports/findings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "reports/report_data.h"
#include "reports/headlines.h"
#include "reports/report_data.h"
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

/// It held the best against the next by rate alone, p = 0.03, and said yes; the one after it is nearer in the flips, and
/// of three pairs none is significant.
TEST(Findings, TheBestPolicyHasToBeatEveryOtherOneAfterHolm) {
  const std::string a = std::string(30, 's') + std::string(10, 'f');
  const std::string b = std::string(24, 's') + std::string(16, 'f');                 // 6 to 0
  const std::string c = std::string(15, 's') + std::string(15, 'f') + "ssssssssff";  // 15 to 8
  const ReportData report =
      ReportDataOf(RepeatedRun({{"t", "a", {a}, {}}, {"t", "b", {b}, {}}, {"t", "d", {c}, {}}}));
  for (const RateCell& cell : report.summary.rates) EXPECT_EQ(cell.letters, "a") << cell.policy;
  const std::vector<Finding> findings = FindingsOf(report.summary);
  const Finding& best = findings.at(findings.size() - 2);
  EXPECT_EQ(best.question, "Which policy is best at t in real?");
  EXPECT_EQ(best.decision, Decision::kNotDecided);
  EXPECT_THAT(best.answer,
              AllOf(HasSubstr("Between a@c 30/40 = 75 % [60, 86] and d@c 23/40 = "),
                    HasSubstr("and not decided against 1 other. In 40 shared initial states, 15 to 8 where only one"),
                    HasSubstr("exact McNemar p = 0.21; after Holm over the 3 pairs of policies in real p = ")));
  const std::vector<Finding> of_two = FindingsOf(RepeatedRun({{"t", "a", {a}, {}}, {"t", "b", {b}, {}}}));
  EXPECT_EQ(of_two.at(of_two.size() - 2).decision, Decision::kYes) << "of two alone 6 to 0 decides";
}

/// The test was on the few shared pairs, beside rates of all episodes.
TEST(Findings, PoliciesThatShareFewStatesAreHeldAgainstEachOtherAsTwoSamples) {
  const std::vector<Finding> findings = FindingsOf(RepeatedRun({{"a", "p", {"ssssssssss"}, {}},
                                                                {"a", "q", {"----------sffffffff"}, {}},
                                                                {"a", "r", {"-------------------ffffffffff"}, {}}}));
  const Finding& best = findings.at(findings.size() - 2);
  EXPECT_EQ(best.decision, Decision::kYes);
  EXPECT_THAT(best.answer,
              AllOf(HasSubstr("p@c 10/10 = "), HasSubstr("ahead of q@c 1/9 = "),
                    HasSubstr(", the closest, and of 1 other. Of 10 and 9 episodes, not on the same initial states: "
                              "Boschloo p < 0.001; after Holm over the 3 pairs of policies in real p ")));
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

/// 199 of 200 were 100 %, 1 of 200 was 0 %; 9996 of 10000 were 100.0 %.
TEST(Wording, AllAndNoneAreSaidOfAllAndNoneAlone) {
  EXPECT_EQ(Percent(199.0 / 200), "99.5 %");
  EXPECT_EQ(Percent(1.0 / 200), "0.5 %");
  EXPECT_EQ(Percent(0.9996), "99.9 %");
  EXPECT_EQ(Percent(0.0003), "0.1 %");
  EXPECT_EQ(Percent(1), "100 %");
  EXPECT_EQ(Percent(1 - 1e-15), "100 %") << "an interval's end, by its arithmetic";
  EXPECT_EQ(Percent(1e-15), "0 %");
  EXPECT_EQ(Percent(0.006), "1 %");
  EXPECT_EQ(Percent(0.994), "99 %");
}

/// One went to the even neighbour, the other away from 0: a page's row and its tooltip named two numbers.
TEST(Wording, ADifferenceIsTheSameNumberWhereverItIsSaid) {
  for (const double share : {0.125, -0.125, 0.375, -0.625, 0.005, -0.005}) {
    Estimate difference;
    difference.value = share;
    difference.interval = Interval{share, share};
    const std::string said = PointsWithInterval(difference);
    const int alone = std::stoi(SignedPoints(share));
    EXPECT_EQ(alone, std::stoi(said)) << said;
    EXPECT_THAT(said, HasSubstr(fmt::format("[{0}, {0}]", alone)));
  }
  EXPECT_EQ(SignedPoints(0.125), "+13");
  EXPECT_EQ(SignedPoints(-0.125), "-13");
}

TEST(Wording, UndefinedIsAReasonAndNotADigit) {
  Estimate estimate;
  estimate.value = Undefined{"no trials"};
  EXPECT_EQ(PercentWithInterval(estimate), "undefined: no trials");
  EXPECT_EQ(NumberWithInterval(estimate), "undefined: no trials");
}


/// "All 4 episodes ran to their end", of a run that was killed at its beginning.
TEST(Findings, ARunThatLacksEpisodesOfItsSuiteIsNotComplete) {
  SampleRun run({{"a", "pick", "1", "ss", "ss"}});
  const auto last = [&run] { return FindingsOf(run.Summary()).back(); };
  EXPECT_EQ(last().decision, Decision::kYes) << "an earlier evac did not say how many there are to be";
  run.store().AddPlan({{"a", "real", "pick", "1", 2}, {"a", "sim", "pick", "1", 40}});
  EXPECT_EQ(last().decision, Decision::kNo);
  EXPECT_EQ(last().answer,
            "4 of 42 episodes of the suite are there: the run goes on, was broken off, or is a part.");
  std::string next;
  const auto headlines = HeadlinesOf(ReportDataOf(run.Summary()));
  for (const HeadlineItem& item : headlines.back().items) next += item.text + "\n";
  EXPECT_THAT(next, HasSubstr("38 of 42 episodes are not there yet: evac resume RUN"));
}

TEST(Findings, OfARunThatLacksEpisodesWhatIsInNoRateIsSaidToo) {
  SampleRun run({{"a", "pick", "1", "se", "ss"}});
  run.store().AddPlan({{"a", "sim", "pick", "1", 3}});
  EXPECT_THAT(FindingsOf(run.Summary()).back().answer,
              AllOf(HasSubstr("2 of 3 episodes of the suite are there"),
                    HasSubstr(" 3 of 4 episodes count. In no rate: 1 error.")));
}

}  // namespace
}  // namespace evac
