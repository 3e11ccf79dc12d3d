#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "core/error.h"
#include "core/store.h"
#include "tests/apps/printed.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// `evac compare --sequential` over folders: what it keeps of its looks, and for which comparison.
class CompareLooks : public testing::Test {
 protected:
  struct OneRun {
    std::string checkpoint, suite_hash;
    Label label = Label::kSuccess;  ///< of all ten initial states
    std::string judge = "oracle";
  };

  /// A run of one policy in sim. @returns its folder
  std::string Write(const std::string& name, const OneRun& run) const {
    RunInfo info = samples::SomeRun();
    info.suite_hash = run.suite_hash;
    Store store = Store::CreateOrContinue(folder_ / name, info);
    store.AddTask(samples::SomeTask());
    store.AddWorld({.name = "sim", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
    store.AddPolicy({"visual_pick", run.checkpoint, "{}"});
    for (int state = 0; state < 10; ++state) {
      EpisodeRecord record;
      record.episode.key = samples::Key(1, "sim");
      record.episode.key.pair.initial_state = "41-000" + std::to_string(state);
      record.episode.key.pair.checkpoint = run.checkpoint;
      record.episode.stop = StopReason::kStill;
      store.Add(record);
      Verdict verdict;
      verdict.episode_id = record.episode.key.Id();
      verdict.judge = run.judge;
      verdict.label = run.label;
      store.AddVerdict(verdict);
    }
    return (folder_ / name).string();
  }

  /// One more world for a run, in which its policy did well in one initial state.
  static void AddWorld(const std::string& folder, const std::string& checkpoint, const std::string& state) {
    Store store = Store::Open(folder, Store::Mode::kReadWrite);
    store.AddWorld({.name = "tale", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
    EpisodeRecord record;
    record.episode.key = samples::Key(1, "tale");
    record.episode.key.pair.initial_state = state;
    record.episode.key.pair.checkpoint = checkpoint;
    record.episode.stop = StopReason::kStill;
    store.Add(record);
    Verdict verdict;
    verdict.episode_id = record.episode.key.Id();
    verdict.judge = "oracle";
    verdict.label = Label::kSuccess;
    store.AddVerdict(verdict);
  }

  static nlohmann::json Bet(const std::string& a, const std::string& b, const std::string& judge = "oracle") {
    const std::string out = Printed(AddCompare, {"compare", a, b, "--judge", judge, "--sequential", "--json"});
    return nlohmann::json::parse(out).at("worlds").at(0).at("sequential").at(0);
  }

  const TempFolder folder_;
};

TEST_F(CompareLooks, EvidenceAgainstOneRunIsNoneAgainstAnother) {
  const std::string a = Write("a", {"good", "aaa"});
  const std::string b = Write("b", {"poor", "bbb", Label::kFailure});
  EXPECT_GT(Bet(a, b).at("largest").get<double>(), 20);
  // The same policy by name, in which nothing differs from a: of another suite, and of b's.
  for (const std::string& other : {Write("c", {"poor", "ccc"}), Write("d", {"poor", "bbb"})}) {
    const nlohmann::json bet = Bet(a, other);
    EXPECT_DOUBLE_EQ(bet.at("largest").get<double>(), 1) << other;
    EXPECT_EQ(bet.at("looks"), 1) << other;
  }
  EXPECT_GT(Bet(a, b).at("largest").get<double>(), 20) << "b's is still there";
  EXPECT_EQ(Bet(a, b).at("looks"), 1) << "the same data are no new look";
}

TEST_F(CompareLooks, NoneIsKeptOfAnyWorldWhereOneHasNoPairs) {
  const std::string a = Write("a", {"good", "aaa"}), b = Write("b", {"poor", "bbb", Label::kFailure});
  AddWorld(a, "good", "41-0000");
  AddWorld(b, "poor", "41-0001");
  EXPECT_THAT([&] { Printed(AddCompare, {"compare", a, b, "--sequential"}); },
              testing::ThrowsMessage<Error>(HasSubstr("--sequential bets on pairs")));
  EXPECT_TRUE(Store::Open(a, Store::Mode::kReadOnly).Looks().empty());
}

TEST_F(CompareLooks, AFolderWhoseNameIsNoTextIsNamedAllTheSame) {
  const std::string a = Write("a\xff", {"good", "aaa"}), b = Write("b", {"good", "bbb"});
  const std::string out = Printed(AddCompare, {"compare", a, b, "--json"});
  EXPECT_THAT(nlohmann::json::parse(out).dump(), HasSubstr("a\xef\xbf\xbd:visual_pick@good"));
}

TEST_F(CompareLooks, TheJudgeIsNamedInFull) {
  const std::string a = Write("a", {"good", "aaa", Label::kSuccess, "classifier:abc"});
  const std::string b = Write("b", {"poor", "bbb", Label::kFailure, "classifier:abc"});
  Bet(a, b, "classifier");
  const auto looks = Store::Open(a, Store::Mode::kReadOnly).Looks();
  ASSERT_EQ(looks.size(), 1u);
  EXPECT_THAT(looks[0].comparison, HasSubstr("visual_pick@good against visual_pick@poor of bbb at "));
  EXPECT_THAT(looks[0].comparison, HasSubstr("in sim, judge classifier:abc"));
  const std::string c = Write("c", {"poor", "ccc", Label::kFailure, "classifier:def"});
  Bet(a, c, "classifier");
  EXPECT_THAT(Store::Open(a, Store::Mode::kReadOnly).Looks().back().comparison,
              HasSubstr("judge classifier:abc and classifier:def"));
}

TEST_F(CompareLooks, TwoJudgesOfOneShortNameAreBothNamedAndWarnedOf) {
  const std::string a = Write("a", {"good", "aaa", Label::kSuccess, "classifier:abc"});
  const std::string b = Write("b", {"poor", "bbb", Label::kFailure, "classifier:def"});
  const std::string c = Write("c", {"poor", "ccc", Label::kFailure, "classifier:abc"});
  testing::internal::CaptureStderr();
  EXPECT_THAT(Printed(AddCompare, {"compare", a, b, "--judge", "classifier"}),
              HasSubstr("World sim, judge classifier:abc of visual_pick@good and classifier:def of visual_pick@poor."));
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("warning: " + a + " is judged by classifier:abc and " + b + " by classifier:def: "));
  testing::internal::CaptureStderr();
  EXPECT_THAT(Printed(AddCompare, {"compare", a, c, "--judge", "classifier"}),
              HasSubstr("World sim, judge classifier:abc. "));
  const auto json = nlohmann::json::parse(Printed(AddCompare, {"compare", a, c, "--judge", "classifier", "--json"}));
  EXPECT_EQ(json.at("worlds").at(0).at("second_judge"), "classifier:abc");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace evac
