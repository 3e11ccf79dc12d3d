#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "core/store.h"
#include "tests/core/store_samples.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using namespace samples;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

class Ls : public testing::Test {
 protected:
  Ls() {
    Declare(store_);
    store_.Add(SomeEpisode(store_, Key(2, "sim")));
    store_.Add(SomeEpisode(store_, Key(10, "real"), StopReason::kPolicyTimeout));
    store_.Add(SomeEpisode(store_, Key(2, "real")));
    AddVerdict("oracle", Label::kFailure);
    AddVerdict("human:ann", Label::kCannotTell);
    AddVerdict("oracle", Label::kSuccess);
  }

  void AddVerdict(const std::string& judge, Label label) {
    store_.AddVerdict({.episode_id = Key(2, "sim").Id(),
                       .judge = judge,
                       .label = label,
                       .probability = {},
                       .stages = {},
                       .reason = "",
                       .rubric_version = ""});
  }

  /// While the run is open for writing.
  std::string Print(std::vector<std::string> options) const {
    options.insert(options.begin(), {"ls", (folder_ / "run").string()});
    return Printed(AddLs, options);
  }

  std::vector<std::string> Listed(const std::vector<std::string>& options) const {
    std::vector<std::string> all = {"--json"}, listed;
    all.insert(all.end(), options.begin(), options.end());
    for (const auto& episode : nlohmann::json::parse(Print(all))) {
      listed.push_back(episode.at("world").get<std::string>() + " " + episode.at("seed").dump());
    }
    return listed;
  }

  const TempFolder folder_;
  Store store_ = Store::CreateOrContinue(folder_ / "run", SomeRun());
};

TEST_F(Ls, JsonHoldsEveryEpisodeInPairKeyOrderWithItsCurrentVerdicts) {
  const auto list = nlohmann::ordered_json::parse(Print({"--json"}));
  ASSERT_EQ(list.size(), 3u);
  EXPECT_THAT(Listed({}), ElementsAre("real 2", "sim 2", "real 10"));
  const std::string video = "videos/sim/take_bottle/visual_pick@good/41-0007-s2.mp4";
  const nlohmann::ordered_json wanted = {{"task", "take_bottle"},
                                         {"initial_state", "41-0007"},
                                         {"policy", "visual_pick"},
                                         {"checkpoint", "good"},
                                         {"world", "sim"},
                                         {"seed", 2},
                                         {"stop", "still"},
                                         {"stop_reason", "commanded 1.2 mm, observed 0.9 mm"},
                                         {"chunks", 2},
                                         {"failure", nullptr},
                                         {"video", video},
                                         {"video_sha256", store_.Episodes().at(1).video_sha256},
                                         {"verdicts", {{"human:ann", "cannot_tell"}, {"oracle", "success"}}}};
  EXPECT_EQ(list.at(1).dump(), wanted.dump());
  EXPECT_EQ(list.at(2).at("failure"), "the policy answered NaN");
  EXPECT_EQ(list.at(2).at("verdicts"), nlohmann::ordered_json::object());
}

TEST_F(Ls, TheLargestSeedIsPrintedAsItIs) {
  store_.Add(SomeEpisode(store_, Key(-1, "sim")));
  EXPECT_THAT(Listed({}), ElementsAre("real 2", "sim 2", "real 10", "sim 18446744073709551615"));
}

TEST_F(Ls, FiltersKeepWhatFits) {
  EXPECT_THAT(Listed({"--failed"}), ElementsAre("real 10"));
  EXPECT_THAT(Listed({"--world", "real"}), ElementsAre("real 2", "real 10"));
  EXPECT_THAT(Listed({"--world", "sim", "--failed"}), ElementsAre());
  EXPECT_THAT(Listed({"--task", "take_bottle", "--policy", "visual_pick"}), ElementsAre("real 2", "sim 2", "real 10"));
}

TEST_F(Ls, ANameThatNothingHasIsRefusedWithThoseThereAre) {
  try {
    Print({"--world", "reel"});
    FAIL() << "wanted an error";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), HasSubstr("'reel', wanted one of: real, sim"));
  }
}

TEST_F(Ls, TheTableEndsWithASummary) {
  const std::string table = Print({});
  EXPECT_THAT(table, StartsWith("TASK"));
  EXPECT_THAT(table, HasSubstr("\ntake_bottle  41-0007        visual_pick@good  2     sim    2       still           "
                               "human:ann=cannot_tell oracle=success\n"));
  EXPECT_THAT(table, HasSubstr("failed: real/take_bottle/visual_pick@good/41-0007-s10: the policy answered NaN\n"));
  EXPECT_THAT(table, HasSubstr("\n3 episodes (1 task, 1 policy, 2 worlds), 1 failed, 1 judged\n"));
}

TEST_F(Ls, RatesCountWhatAJudgeSaidAndSayWhatTheyDoNotCount) {
  const std::string rates = Print({"--rates"});
  EXPECT_THAT(rates, StartsWith("TASK"));
  EXPECT_THAT(rates, HasSubstr("take_bottle  visual_pick@good  real   2         undefined"));
  EXPECT_THAT(rates, HasSubstr("1 error, 1 not judged\n"));
  EXPECT_THAT(rates, HasSubstr("take_bottle  visual_pick@good  sim    1         100 % [21, 100]       -\n"));
  EXPECT_THAT(Print({"--rates", "--world", "sim"}), testing::Not(HasSubstr("real")));
  EXPECT_THAT(Print({"--rates", "--judge", "human:ann"}), HasSubstr("1 cannot tell\n"));
}

TEST_F(Ls, RatesOfAJudgeAreFoundByTheBeginningOfItsName) {
  AddVerdict("classifier:0123456789ab", Label::kFailure);
  EXPECT_EQ(Print({"--rates", "--judge", "classifier"}), Print({"--rates", "--judge", "classifier:0123456789ab"}));
  EXPECT_THAT(Print({"--rates", "--judge", "classifier"}), HasSubstr("sim    1         0 % [0, 79]"));
}

TEST_F(Ls, RatesOfAJudgeWhoGaveNoVerdictAndOfSeveralAreRefused) {
  for (const auto& [judge, words] : std::vector<std::pair<std::string, std::string>>{
           {"orakel", "'orakel', wanted one of: human:ann, oracle"}, {"oracle,human:ann", "wanted one judge"}}) {
    try {
      Print({"--rates", "--judge", judge});
      FAIL() << "wanted an error for " << judge;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  }
}

TEST_F(Ls, HowTheWireMisbehavedIsShownWhereItDid) {
  EXPECT_THAT(Print({}), testing::Not(HasSubstr("wire:")));
  store_.Count("visual_pick@good", {{"repeats", 31}, {"late_replies", 0}, {"timeouts", 2}});
  EXPECT_THAT(Print({}), HasSubstr("wire: visual_pick@good: 31 repeats, 2 timeouts\n"));
}

}  // namespace
}  // namespace evac
