#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reports/chart_files.h"
#include "reports/charts.h"
#include "reports/dashboard_pages.h"
#include "reports/page.h"
#include "reports/page_parts.h"
#include "tests/reports/sample_run.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::Not;

/// Worlds evac, real and sim; evac ends as sim does, but its judge tells no stages.
RunSummary WithAWorldThatTellsNoStages() {
  SampleRun run({{"take", "pick", "1", "sssssfff", "ssssffff"}, {"take", "pick", "2", "ssffffff", "sfffffff"}});
  run.store().AddWorld({"evac", "evac", false, "evac-profile"});
  for (const JudgedEpisode& sim : run.Summary().episodes) {
    if (sim.episode.key.world != "sim") continue;
    EpisodeRecord record;
    record.episode.key = {sim.episode.key.pair, "evac"};
    record.episode.chunks = sim.episode.chunks;
    record.episode.stop = sim.episode.stop;
    record.episode.stop_reason = sim.episode.stop_reason;
    run.store().Add(record);
    Verdict verdict;
    verdict.episode_id = record.episode.key.Id();
    verdict.judge = "oracle";
    verdict.label = sim.verdict->label;
    run.store().AddVerdict(verdict);
  }
  return run.Summary();
}

std::string SectionOf(const std::string& page, const std::string& id) {
  const std::size_t begin = page.find("<section id=\"" + id + "\"");
  return page.substr(begin, page.find("</section>", begin) - begin);
}

TEST(WorldMarks, TheRealWorldsIsItsOwnAndTheOthersCountOn) {
  EXPECT_EQ(MarksOf("real", {"evac", "real", "sim", "evac"}), (WorldMarks{{"real", 0}, {"evac", 1}, {"sim", 2}}));
  EXPECT_EQ(MarksOf("", {"evac", "sim"}).at("evac"), 1u);
  for (std::size_t world = 1; world < 20; ++world) {
    EXPECT_NE(WorldShape(world), WorldShape(0)) << world;
    EXPECT_NE(WorldSign(world), WorldSign(0)) << world;
  }
}

/// Stages numbered the worlds that tell some: sim had the mark that is evac's among the rates. Trust had one for all.
TEST(WorldMarks, AWorldHasTheSameInEveryPartOfThePage) {
  const std::string page = ReportPage(WithAWorldThatTellsNoStages(), {"", "evac test"});
  EXPECT_THAT(SectionOf(page, "rates"), AllOf(HasSubstr(MarkerIcon(WorldShape(1), "dot w1") + "evac"),
                                              HasSubstr(MarkerIcon(WorldShape(2), "dot w2") + "sim")));
  EXPECT_THAT(SectionOf(page, "stages"),
              AllOf(HasSubstr(WorldKey(0, "real")), HasSubstr(WorldKey(2, "sim")), HasSubstr("<g class=\"w2\">"),
                    Not(HasSubstr("<g class=\"w1\">"))));
  EXPECT_THAT(SectionOf(page, "trust"), AllOf(HasSubstr("<g class=\"w1\">"), HasSubstr("<g class=\"w2\">")));
}

/// Its legend read "● real, ◇ sim".
TEST(WorldMarks, AChartsFileNamesThemAsThePageDoes) {
  EXPECT_THAT(ChartFilesOf(ReportDataOf(WithAWorldThatTellsNoStages())),
              Contains(AllOf(Field(&ChartFile::name, "stages-take-pick_1"),
                             Field(&ChartFile::svg, HasSubstr("reached, %: ● real, ▽ sim")))));
}

/// The first world of a chart had the real one's mark, though none was real.
TEST(WorldMarks, WithoutARealWorldNobodyHasItsMark) {
  RunData data = ReadRun(LargeRun().store());
  for (WorldInfo& world : data.worlds) world.is_real = false;
  const std::string page = ReportPage(Summarise(data, {}), {"", "evac test"});
  for (const char* part : {"rates", "stages", "checkpoints"})
    EXPECT_THAT(SectionOf(page, part), AllOf(HasSubstr("class=\"w1\""), Not(HasSubstr("class=\"w0\"")))) << part;
}

/// In the chart of a policy that only a run without a real world has, ● was sim.
TEST(WorldMarks, OnADashboardTheyAreTheSameForAllRuns) {
  const DashboardRun both = DashboardRunOf("both", ReportDataOf(WithAWorldThatTellsNoStages()));
  RunData data = ReadRun(SampleRun({{"take", "pick", "3", "", "sf"}}).store());
  std::erase_if(data.worlds, [](const WorldInfo& world) { return world.is_real; });
  const DashboardRun only_sim = DashboardRunOf("only sim", ReportDataOf(Summarise(data, {})));
  for (const std::vector<DashboardRun>& runs : {std::vector{both, only_sim}, {only_sim, both}}) {
    const std::string page = DashboardIndex(runs, "evac test");
    EXPECT_THAT(page, AllOf(HasSubstr(WorldKey(0, "real")), Not(HasSubstr(WorldKey(0, "sim")))));
    const bool sim_is_first = runs.front().name == "only sim";
    EXPECT_THAT(page, AllOf(HasSubstr(WorldKey(sim_is_first ? 1 : 2, "sim")),
                            Not(HasSubstr(WorldKey(sim_is_first ? 2 : 1, "sim")))));
  }
}

/// "At no stage do these pairs show that evac is kinder or harder than real" was said of no pair at all.
TEST(Page, OfAWorldThatTellsNoStagesNothingIsSaidToBeShown) {
  const std::string stages = SectionOf(ReportPage(WithAWorldThatTellsNoStages(), {"", "evac test"}), "stages");
  EXPECT_THAT(stages, HasSubstr("Of evac nothing can be said here: no pair of episodes tells the stages there and in "
                                "real."));
  EXPECT_THAT(stages, Not(HasSubstr("show that evac")));
  EXPECT_THAT(stages, HasSubstr("At no stage do these pairs show that sim is kinder or harder than real."));
}

}  // namespace
}  // namespace evac
