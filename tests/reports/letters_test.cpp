#include "reports/letters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "reports/methods.h"
#include "reports/page.h"
#include "reports/report_data.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

/// Of one world: "task policy" → letters.
std::map<std::string, std::string> LettersOf(const ReportData& report, const std::string& world) {
  std::map<std::string, std::string> letters;
  for (const RateCell& cell : report.summary.rates) {
    if (cell.world == world) letters[cell.task + " " + cell.policy] = cell.letters;
  }
  return letters;
}

using Letters = std::map<std::string, std::string>;

TEST(Letters, JoinPoliciesThatDoNotDifferAndPartThoseThatDo) {
  const std::string good(20, 's'), bad(20, 'f');
  const std::string fair = "sssssssssssssssssfff";
  const ReportData report = ReportDataOf(
      SampleRun({{"a", "pick", "bad", bad, good}, {"a", "pick", "good", good, good}, {"a", "pick", "fair", fair, good}})
          .Summary());
  EXPECT_EQ(report.letters.pairs, 3);
  EXPECT_EQ(LettersOf(report, "real"), (Letters{{"a pick@good", "a"}, {"a pick@fair", "a"}, {"a pick@bad", "b"}}));
  EXPECT_EQ(LettersOf(report, "sim"), (Letters{{"a pick@good", "a"}, {"a pick@fair", "a"}, {"a pick@bad", "a"}}));
}

TEST(Letters, AreHeldToAllPairsThatAWorldShows) {
  // Six against none: p = .031 alone, and not significant as one of six.
  const std::string better = "ssssssffff", worse = "ffffffffff";
  const std::vector<SampleCell> alone = {{"a", "pick", "1", better, worse}, {"a", "pick", "2", worse, worse}};
  EXPECT_EQ(LettersOf(ReportDataOf(SampleRun(alone).Summary()), "real"),
            (Letters{{"a pick@1", "a"}, {"a pick@2", "b"}}));
  std::vector<SampleCell> among = alone;
  for (const char* task : {"b", "c", "d", "e", "f"}) {
    among.push_back({task, "pick", "1", worse, worse});
    among.push_back({task, "pick", "2", worse, worse});
  }
  const ReportData report = ReportDataOf(SampleRun(among).Summary());
  EXPECT_EQ(report.letters.pairs, 6);
  EXPECT_EQ(LettersOf(report, "real").at("a pick@2"), "a");
}

TEST(Letters, ComparePairsAndNotRates) {
  // The same rates, 5 of 10 and 9 of 10: in other states for the first, where the flips cancel.
  const std::vector<SampleCell> cells = {{"a", "pick", "1", "sssssssfff", "u"}, {"a", "pick", "2", "fffsssssss", "u"}};
  const ReportData report = ReportDataOf(SampleRun(cells).Summary());
  EXPECT_EQ(LettersOf(report, "real"), (Letters{{"a pick@1", "a"}, {"a pick@2", "a"}}));
}

TEST(Letters, PoliciesThatShareFewStatesAreComparedAsTwoSamples) {
  const std::vector<SampleCell> cells = {
      {"a", "pick", "1", "ssssssssss----------", "u"}, {"a", "pick", "2", "----------ffffffffff", "u"}};
  const ReportData report = ReportDataOf(SampleRun(cells).Summary());
  EXPECT_THAT(report.letters.unpaired_tests, testing::ElementsAre("Boschloo"));
  EXPECT_EQ(LettersOf(report, "real"), (Letters{{"a pick@1", "a"}, {"a pick@2", "b"}}));
}

TEST(Letters, ThePageNamesTheTestsThatWereMade) {
  const auto page = [](const Outcomes& one, const Outcomes& two) {
    const SampleRun run({{"a", "pick", "1", one, "u"}, {"a", "pick", "2", two, "u"}});
    return ReportPage(run.Summary(), {"", "evac test"});
  };
  const std::string apart = page("ssssssssss----------", "----------ffffffffff"), together = page("ssss", "fsfs");
  EXPECT_THAT(apart, testing::HasSubstr("exact McNemar over shared initial states, Boschloo where fewer than 80 % are "
                                        "shared"));
  EXPECT_THAT(together, testing::Not(testing::HasSubstr("Boschloo")));
  EXPECT_THAT(apart, testing::HasSubstr("with the first one, on the same initial states where at least 80 % of them are "
                                        "shared"))
      << "of two checkpoints without one such state";
}

TEST(Letters, MoreUnpairedEpisodesThanAnExactTestTakesAreComparedAllTheSame) {
  const std::string gap(3000, '-'), one = std::string(1800, 's') + std::string(1200, 'f'),
                                    two = gap + std::string(1155, 's') + std::string(945, 'f');
  const ReportData report = ReportDataOf(RepeatedRun({{"a", "p", {one}, {}}, {"a", "q", {two}, {}}}));
  EXPECT_THAT(report.letters.unpaired_tests, testing::ElementsAre("Newcombe"));
  EXPECT_EQ(LettersOf(report, "real"), (Letters{{"a p@c", "a"}, {"a q@c", "b"}}));
  const std::string methods = MethodsParagraph(report);
  EXPECT_THAT(methods, testing::HasSubstr("Newcombe where fewer than 80 % are shared"));
  EXPECT_THAT(methods, testing::Not(testing::HasSubstr("Boschloo")));
}

/// Of the real world, each cell's letters.
std::vector<std::string> LettersOfRepeats(const std::vector<RepeatedCell>& cells) {
  RunSummary summary = RepeatedRun(cells);
  GiveLetters(summary.episodes, 0.05, summary.rates);
  std::vector<std::string> letters;
  for (const RateCell& cell : summary.rates) letters.push_back(cell.letters);
  return letters;
}

TEST(Letters, RepeatsOfOneStateDoNotPartPolicies) {
  // Three states of four flip, whatever the number of seeds.
  EXPECT_EQ(LettersOfRepeats({{"a", "p", Alike(10, "ssss"), {}}, {"a", "q", Alike(10, "sfff"), {}}}),
            (std::vector<std::string>{"a", "a"}));
  // As two samples: two states against two others.
  EXPECT_EQ(LettersOfRepeats({{"a", "p", Alike(10, "ss"), {}}, {"a", "q", Alike(10, "--ff"), {}}}),
            (std::vector<std::string>{"a", "a"}));
  EXPECT_EQ(LettersOfRepeats({{"a", "p", Alike(10, "ssssssss"), {}}, {"a", "q", Alike(10, "ffffffff"), {}}}),
            (std::vector<std::string>{"a", "b"}));
}

TEST(Letters, NobodyToDifferFromGetsNone) {
  const ReportData report =
      ReportDataOf(SampleRun({{"a", "pick", "1", "sss", "sss"}, {"a", "pick", "2", "eee", "uuu"}}).Summary());
  EXPECT_EQ(report.letters.pairs, 0);
  EXPECT_EQ(LettersOf(report, "real"), (Letters{{"a pick@1", ""}, {"a pick@2", ""}}));
}

}  // namespace
}  // namespace evac
