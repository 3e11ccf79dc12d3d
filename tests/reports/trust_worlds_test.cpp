#include "reports/trust_worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "reports/headlines.h"
#include "reports/page.h"
#include "tests/reports/stored_run.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A run with a third world, which nobody judged: the oracle cannot tell anything of an imagined one.
class OneWorldUnjudged : public testing::Test {
 protected:
  OneWorldUnjudged() {
    run_.store().AddWorld({"dream", "evac", false, "dream-profile"});
    for (const char* state : {"41-0000", "41-0001"}) {
      const EpisodeKey key{{"take", state, "pick", "1", 1}, "dream"};
      run_.AddEpisode(key, 's');
      run_.store().AddVerdict({.episode_id = key.Id(),
                               .judge = "oracle",
                               .label = Label::kCannotTell,
                               .probability = {},
                               .stages = {},
                               .reason = "no physics",
                               .rubric_version = "v1"});
    }
  }

  RunSummary Summary() const { return Summarise(ReadRun(run_.store()), {.bootstrap_replicates = 1}); }

  StoredRun run_{"run", "sfsf", "sfss"};
};

TEST_F(OneWorldUnjudged, TakesNoStatementAwayFromTheOthers) {
  const WorldsTrust trust = TrustOfWorlds(Summary(), {"dream", "sim"}, {});
  ASSERT_EQ(trust.worlds.size(), 1u);
  EXPECT_EQ(trust.worlds[0].world, "sim");
  EXPECT_EQ(trust.worlds[0].tasks.at(0).pairs.n(), 4);
  ASSERT_EQ(trust.unsaid.size(), 1u);
  EXPECT_EQ(trust.unsaid[0].world, "dream");
  EXPECT_EQ(trust.unsaid[0].reason, "no imagined episode is judged a success or a failure");
}

TEST_F(OneWorldUnjudged, IsNamedWithTheReasonWhereverTrustIsShown) {
  const ReportData report = ReportDataOf(Summary());
  ASSERT_EQ(report.trust.size(), 1u);
  EXPECT_EQ(report.no_trust, "");
  const std::string page = ReportPage(report, PageOptions{});
  EXPECT_THAT(page, AllOf(HasSubstr("May sim stand for the real world?"), HasSubstr("May dream stand for the real")));
  EXPECT_THAT(page, HasSubstr("No statement: no imagined episode is judged"));
  const Headline trusted = HeadlinesOf(report).at(2);
  EXPECT_THAT(trusted.question, HasSubstr("the other worlds"));
  EXPECT_THAT(trusted.items.front().text, HasSubstr("sim, take: "));
  EXPECT_THAT(trusted.items.back().text, HasSubstr("dream: no imagined episode"));
  const WorldsTrust trust = TrustOfWorlds(Summary(), {"sim", "dream"}, {});
  EXPECT_THAT(TrustText(trust), AllOf(HasSubstr("May sim be trusted? Held against the world real"),
                                      HasSubstr("\nMay dream be trusted? Nothing can be said: no imagined")));
  const auto json = TrustJson(trust);
  ASSERT_EQ(json.at("worlds").size(), 1u);
  EXPECT_EQ(json.at("worlds").at(0).at("world"), "sim");
  EXPECT_EQ(json.at("unsaid").at(0).at("world"), "dream");
}

TEST(WhyNothingIsSaid, IsOneReasonWhereAllShareItAndElseEachWorldsOwn) {
  EXPECT_THAT(WhyNothingIsSaid({}), HasSubstr("no world beside the real one"));
  EXPECT_EQ(WhyNothingIsSaid({{"a", "not judged"}, {"b", "not judged"}}), "not judged");
  EXPECT_EQ(WhyNothingIsSaid({{"a", "not judged"}, {"b", "no such world"}}), "a: not judged; b: no such world");
}

}  // namespace
}  // namespace evac
