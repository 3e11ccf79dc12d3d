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
    Label label = Label::kSuccess;  ///< of all initial states
    std::string judge = "oracle";
    std::string page = samples::SomeTask().page, profile_hash = "ba5";
    int states = 10;
  };

  /// A run of one policy in sim. @returns its folder
  std::string Write(const std::string& name, const OneRun& run) const {
    RunInfo info = samples::SomeRun();
    info.suite_hash = run.suite_hash;
    Store store = Store::CreateOrContinue(folder_ / name, info);
    Task task = samples::SomeTask();
    task.page = run.page;
    store.AddTask(task);
    store.AddWorld({.name = "sim", .type = "mujoco", .is_real = false, .profile_hash = run.profile_hash});
    store.AddPolicy({"visual_pick", run.checkpoint, "{}"});
    for (int state = 0; state < run.states; ++state) {
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

  static void AddJudged(Store& store, const EpisodeKey& key, Label label) {
    EpisodeRecord record;
    record.episode.key = key;
    record.episode.stop = StopReason::kStill;
    store.Add(record);
    Verdict verdict;
    verdict.episode_id = key.Id();
    verdict.judge = "oracle";
    verdict.label = label;
    store.AddVerdict(verdict);
  }

  /// One more world for a run, in which its policy did well in one initial state.
  static void AddWorld(const std::string& folder, const std::string& checkpoint, const std::string& state) {
    Store store = Store::Open(folder, Store::Mode::kReadWrite);
    store.AddWorld({.name = "tale", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
    EpisodeKey key = samples::Key(1, "tale");
    key.pair.initial_state = state;
    key.pair.checkpoint = checkpoint;
    AddJudged(store, key, Label::kSuccess);
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

/// "shares 2 of 2 and 10 initial states": a run that was looked at while it ran was refused until 80 % of it was there.
TEST_F(CompareLooks, ARunThatOnlyBeganBetsOnThePairsThatItHas) {
  OneRun begun{"good", "aaa"};
  begun.states = 2;
  const std::string a = Write("a", begun), b = Write("b", {"poor", "bbb", Label::kFailure});
  {
    Store store = Store::Open(b, Store::Mode::kReadWrite);  // a task that a has not come to
    store.AddTask(samples::SomeTask("take_toast"));
    EpisodeKey key = samples::Key(1, "sim");
    key.pair.task = "take_toast";
    key.pair.checkpoint = "poor";
    AddJudged(store, key, Label::kFailure);
  }
  const std::string out = Printed(AddCompare, {"compare", a, b, "--sequential", "--json"});
  const nlohmann::json world = nlohmann::json::parse(out).at("worlds").at(0), bets = world.at("sequential");
  EXPECT_EQ(world.at("tasks").size(), 2u);
  ASSERT_EQ(bets.size(), 2u) << "take_toast waits";
  EXPECT_EQ(bets.at(0).at("task"), "take_bottle");
  EXPECT_TRUE(bets.at(1).at("task").is_null());
  for (const nlohmann::json& bet : bets) {
    EXPECT_EQ(bet.at("pairs"), 2);
    EXPECT_EQ(bet.at("only_first"), 2);
  }
  EXPECT_EQ(Store::Open(a, Store::Mode::kReadOnly).Looks().size(), 2u);
}

TEST_F(CompareLooks, WithoutAnyPairThereIsNothingToBetOn) {
  const std::string a = Write("a", {"good", "aaa", Label::kCannotTell}), b = Write("b", {"poor", "bbb"});
  EXPECT_THAT([&] { Printed(AddCompare, {"compare", a, b, "--sequential"}); },
              testing::ThrowsMessage<Error>(HasSubstr("visual_pick@good and visual_pick@poor have none that counts")));
}

/// "neither A nor B has an episode here": of a run in progress no world was compared.
TEST_F(CompareLooks, AWorldThatNeitherHasBegunIsLeftOutWithANote) {
  const std::string a = Write("a", {"good", "aaa"}), b = Write("b", {"poor", "bbb", Label::kFailure});
  for (const std::string& run : {a, b})
    Store::Open(run, Store::Mode::kReadWrite)
        .AddWorld({.name = "tale", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
  testing::internal::CaptureStderr();
  const std::string out = Printed(AddCompare, {"compare", a, b, "--sequential", "--json"});
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "evac: note: left out, as neither policy has an episode there yet: tale\n");
  const nlohmann::json worlds = nlohmann::json::parse(out).at("worlds");
  ASSERT_EQ(worlds.size(), 1u);
  EXPECT_EQ(worlds.at(0).at("world"), "sim");
  EXPECT_THAT([&] { Printed(AddCompare, {"compare", a, b, "--world", "tale"}); },
              testing::ThrowsMessage<Error>(HasSubstr("has an episode in tale")));
}

/// Before either has finished its first world, the other one has only B's episodes.
TEST_F(CompareLooks, AWorldThatOnlyOneHasBegunWaits) {
  const std::string a = Write("a", {"good", "aaa"}), b = Write("b", {"poor", "bbb", Label::kFailure});
  Store::Open(a, Store::Mode::kReadWrite)
      .AddWorld({.name = "tale", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
  AddWorld(b, "poor", "41-0001");
  const std::string out = Printed(AddCompare, {"compare", a, b, "--sequential", "--json"});
  const nlohmann::json worlds = nlohmann::json::parse(out).at("worlds");
  ASSERT_EQ(worlds.size(), 2u);
  EXPECT_EQ(worlds.at(0).at("sequential").size(), 1u);
  EXPECT_TRUE(worlds.at(1).at("sequential").empty());
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

/// "visual_pick@good is better than visual_pick@poor", of runs before and after an edit, without a word.
TEST_F(CompareLooks, ATaskOrAWorldThatIsAnotherInTheOtherRunIsWarnedOf) {
  const std::string page = samples::SomeTask().page;
  const std::string a = Write("a", {"good", "aaa"});
  const auto warnings = [&](const std::string& name, OneRun run) {
    const std::string b = Write(name, run);
    testing::internal::CaptureStderr();
    EXPECT_THAT(Printed(AddCompare, {"compare", a, b}), HasSubstr("visual_pick@good is better than visual_pick@poor"));
    return testing::internal::GetCapturedStderr();
  };
  OneRun poor{"poor", "bbb", Label::kFailure};
  poor.page = page + "\n# laid out otherwise\n";
  EXPECT_EQ(warnings("same", poor), "");
  poor.page = page + "rubric: {version: r2}\n";
  EXPECT_EQ(warnings("task", poor),
            "evac: warning: the page of task take_bottle is another in " + a + " than in " +
                (folder_ / "task").string() + ": what the policies differ by may be the task's\n");
  poor.page = page;
  poor.profile_hash = "5e7";
  EXPECT_EQ(warnings("world", poor),
            "evac: warning: the profile of world sim is another in " + a + " than in " + (folder_ / "world").string() +
                ": what the policies differ by may be the world's\n");
}

}  // namespace
}  // namespace evac
