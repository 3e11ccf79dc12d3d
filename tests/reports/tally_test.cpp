#include "reports/tally.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

void ExpectTheRatesOfTheSummary(const SampleRun& run, const std::string& judge) {
  const std::vector<RateCell> tallied = TallyRates(run.store(), judge, .95);
  const std::vector<RateCell> summed = run.Summary({.judge = judge}).rates;
  ASSERT_EQ(tallied.size(), summed.size());
  for (std::size_t i = 0; i < tallied.size(); ++i) {
    SCOPED_TRACE(summed[i].task + " " + summed[i].policy + " " + summed[i].world);
    EXPECT_EQ(tallied[i].task + tallied[i].policy + tallied[i].world,
              summed[i].task + summed[i].policy + summed[i].world);
    EXPECT_EQ(tallied[i].counts, summed[i].counts);
    EXPECT_EQ(tallied[i].states, summed[i].states);
    EXPECT_EQ(tallied[i].rate.n, summed[i].rate.n);
    ASSERT_EQ(bool(tallied[i].rate.value), bool(summed[i].rate.value));
    if (!tallied[i].rate.value) continue;
    EXPECT_EQ(*tallied[i].rate.value, *summed[i].rate.value);
    EXPECT_EQ(tallied[i].rate.interval->low, summed[i].rate.interval->low);
    EXPECT_EQ(tallied[i].rate.interval->high, summed[i].rate.interval->high);
  }
}

TEST(Tally, CountsWhatTheSummaryCounts) {
  ExpectTheRatesOfTheSummary(LargeRun(), "oracle");
  const SampleRun mixed({{"take_bottle", "pick", "good", "sssf?ieu", "uue"}, {"place_toast", "pick", "good", "se", "fs"}});
  ExpectTheRatesOfTheSummary(mixed, "oracle");
  ExpectTheRatesOfTheSummary(mixed, "nobody");
}

TEST(Tally, CountsAJudgesLastWordAndRepeatsOfAStateAsOneCluster) {
  SampleRun run({{"take_bottle", "pick", "good", "ssff", "sf"}});
  for (int repeat = 2; repeat < 5; ++repeat) {
    EpisodeRecord record;
    record.episode.key = {{"take_bottle", "41-0000", "pick", "good", static_cast<std::uint64_t>(repeat)}, "real"};
    record.episode.stop = StopReason::kMaxChunks;
    run.store().Add(record);
    for (const Label label : {Label::kFailure, Label::kSuccess}) {
      Verdict verdict;
      verdict.episode_id = record.episode.key.Id();
      verdict.judge = "oracle";
      verdict.label = label;
      run.store().AddVerdict(verdict);
    }
  }
  ExpectTheRatesOfTheSummary(run, "oracle");
  const RateCell real = TallyRates(run.store(), "oracle", .95).at(0);
  EXPECT_EQ(real.Of(Outcome::kSuccess), 5);
  EXPECT_EQ(real.states, 4);
}

TEST(Tally, AConfidenceThatIsNoneIsRefused) { EXPECT_THROW(TallyRates(LargeRun().store(), "oracle", 1), Error); }

}  // namespace
}  // namespace evac
