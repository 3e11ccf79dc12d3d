#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
#include "core/store.h"
#include "core/store_sqlite.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using namespace samples;
using testing::ElementsAre;
using testing::IsEmpty;

RealTrial SomeTrial(std::int64_t trial) {
  return {.task = "take_bottle",
          .initial_state = "41-0007",
          .policy = "visual_pick",
          .checkpoint = "good",
          .trial = trial,
          .outcome = Label::kSuccess,
          .video = trial == 2 ? "real_videos/x.mp4" : "",
          .source = "trials.csv:3"};
}

TEST(StoreTrials, RealTrialsAreKeptInTheOrderAddedAllOrNone) {
  const TempFolder folder;
  Store store = Store::CreateOrContinue(folder / "run", SomeRun());
  store.AddTask(SomeTask());
  store.AddRealTrials({SomeTrial(2), SomeTrial(1)});
  EXPECT_THROW(store.AddRealTrials({SomeTrial(3), SomeTrial(1)}), Error) << "the second is there already";
  RealTrial elsewhere = SomeTrial(4);
  elsewhere.task = "unknown";
  EXPECT_THROW(store.AddRealTrials({SomeTrial(5), elsewhere}), Error);
  EXPECT_THAT(Store::Open(folder / "run", Store::Mode::kReadOnly).RealTrials(),
              ElementsAre(SomeTrial(2), SomeTrial(1)));
}

TEST(StoreTrials, TheyAloneKeepARunFromMakingRoomForAnotherSuite) {
  const TempFolder folder;
  {
    Store store = Store::CreateOrContinue(folder / "run", SomeRun());
    store.AddTask(SomeTask());
    store.AddRealTrials({SomeTrial(1)});
  }
  RunInfo other = SomeRun();
  other.suite_hash = "07e42";
  EXPECT_THROW(Store::CreateOrContinue(folder / "run", other), Error);
}

/// A real episode of a lower seed that ran again took the place of the scene that stored imagined episodes began from.
TEST(StoreScenes, WhatAnImaginedEpisodeBeganFromStays) {
  const TempFolder folder;
  Store store = Store::InMemory(folder.path(), SomeRun());
  Declare(store);
  store.AddWorld({.name = "model", .type = "evac", .is_real = false, .profile_hash = "e7ac"});
  const auto kept = [&](int seed) {
    store.AddInitialScene(Key(seed).pair, {{Image(seed)}, Arms(1), SomeTask().cameras});
    const auto scene = store.LoadInitialScene("take_bottle", "41-0007");
    const std::uint64_t its = store.InitialScenes().at(0).seed;
    EXPECT_EQ(cv::norm(scene->images.at(0), Image(static_cast<int>(its)), cv::NORM_INF), 0);
    return its;
  };
  EXPECT_EQ(kept(9), 9u);
  store.Add(SomeEpisode(store, Key(9)));
  EXPECT_EQ(kept(8), 8u) << "a world of physics begins from none";
  store.Add(SomeEpisode(store, Key(8, "model"), StopReason::kWorldError));
  EXPECT_EQ(kept(7), 7u) << "it runs again";
  store.Add(SomeEpisode(store, Key(7, "model")));
  EXPECT_EQ(kept(6), 7u);
  PairKey earlier = Key(7).pair;
  earlier.policy = "a";
  store.AddInitialScene(earlier, {{Image(7)}, Arms(1), SomeTask().cameras});
  EXPECT_EQ(store.InitialScenes().at(0).policy, "a") << "those of one seed are alike, in whatever order they come";
  PairKey elsewhere = Key(6).pair;
  elsewhere.initial_state = "41-0008";
  store.AddInitialScene(elsewhere, {{Image(6)}, Arms(1), SomeTask().cameras});
  EXPECT_TRUE(store.LoadInitialScene("take_bottle", "41-0008"));
}

TEST(StoreVerdicts, AProbabilityThatIsNoneIsRefused) {
  const TempFolder folder;
  Store store = Store::InMemory(folder.path(), SomeRun());
  Declare(store);
  store.Add(SomeEpisode(store, Key(1)));
  for (const double none : {std::numeric_limits<double>::quiet_NaN(), -0.1, 1.1}) {
    Verdict verdict;
    verdict.episode_id = Key(1).Id();
    verdict.judge = "classifier:abc";
    verdict.label = Label::kSuccess;
    verdict.probability = none;
    EXPECT_THAT([&] { store.AddVerdict(verdict); },
                testing::ThrowsMessage<Error>(testing::HasSubstr("wanted a number from 0 to 1")));
  }
  EXPECT_THAT(store.Verdicts(), IsEmpty());
}

TEST(StoreTrials, LooksAreKeptOldestFirst) {
  const TempFolder folder;
  Store store = Store::InMemory(folder.path(), SomeRun());
  EXPECT_THAT(store.Looks(), IsEmpty());
  const SequentialLook one{"a against b", "", 10, 4, 1, 1.0 / 3}, two{"a against b", "t", 12, 5, 1, 2.5};
  store.AddLooks({one, two});
  store.AddLooks({one});
  EXPECT_THAT(store.Looks(), ElementsAre(one, two, one));
}

TEST(StoreTrials, AGateDecisionThatIsAskedForAgainIsTheLastAndTheSame) {
  const TempFolder folder;
  Store store = Store::InMemory(folder.path(), SomeRun());
  const GateRecord fail{"k1", "nightly", "fail", "{\"a\": 1}"}, pass{"k2", "nightly", "pass", "{}"};
  store.AddGateRecord(fail, {});
  store.AddGateRecord(pass, {});
  store.RepeatGateRecord("k1");
  EXPECT_THAT(store.GateRecords(), ElementsAre(pass, fail));
  store.RepeatGateRecord("k3");
  EXPECT_THAT(store.GateRecords(), ElementsAre(pass, fail)) << "nobody decided that";
  EXPECT_THROW(store.AddGateRecord(fail, {}), Error) << "it is still there once";
}


TEST(StorePlan, IsOfTasksAndWorldsThatAreThereAndTheLargerNumberStays) {
  const TempFolder folder;
  Store store = Store::CreateOrContinue(folder / "run", SomeRun());
  Declare(store);
  EXPECT_THAT(store.Plan(), IsEmpty());
  const PlannedEpisodes real{"take_bottle", "real", "visual_pick", "good", 20};
  const PlannedEpisodes sim{"take_bottle", "sim", "hold", "default", 5};
  store.AddPlan({sim, real});
  PlannedEpisodes fewer = real, elsewhere = real;
  fewer.episodes = 19;
  store.AddPlan({fewer});
  elsewhere.world = "moon";
  EXPECT_THROW(store.AddPlan({elsewhere}), Error);
  EXPECT_THAT(Store::Open(folder / "run", Store::Mode::kReadOnly).Plan(), ElementsAre(real, sim));
}

TEST(StorePlan, APageIsTheSameWithAllFilesThatItNames) {
  const TempFolder folder;
  Store store = Store::InMemory(folder.path(), SomeRun());
  store.AddTask(SomeTask());
  EXPECT_THAT(store.PageHashes(), IsEmpty()) << "nobody said";
  store.AddTask(SomeTask(), "9a9e");
  store.AddTask(SomeTask(), "9a9e");
  EXPECT_THAT(store.PageHashes(), ElementsAre(testing::Pair("take_bottle", "9a9e")));
  EXPECT_THAT([&] { store.AddTask(SomeTask(), "07e42"); },
              testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr("9a9e"), testing::HasSubstr("07e42"))));
}

TEST(StorePlan, GoesWhereARunWithoutEpisodesMakesRoom) {
  const TempFolder folder;
  {
    Store store = Store::CreateOrContinue(folder / "run", SomeRun());
    Declare(store);
    store.AddTask(SomeTask(), "9a9e");
    store.AddPlan({{"take_bottle", "real", "visual_pick", "good", 20}});
  }
  RunInfo other = SomeRun();
  other.suite_hash = "07e42";
  const Store store = Store::CreateOrContinue(folder / "run", other);
  EXPECT_THAT(store.Plan(), IsEmpty());
  EXPECT_THAT(store.PageHashes(), IsEmpty());
}

TEST(StorePlan, ARunOfAnEarlierEvacSaysNoneUntilItGoesOn) {
  const TempFolder folder;
  {
    Store store = Store::CreateOrContinue(folder / "run", SomeRun());
    Declare(store);
  }
  sqlite::Connection::OpenReadWrite(folder / "run/evac.sqlite")
      .RunScript("DROP TABLE planned_episodes; DROP TABLE page_hashes; PRAGMA user_version = 4");
  const Store before = Store::Open(folder / "run", Store::Mode::kReadOnly);
  EXPECT_THAT(before.Plan(), IsEmpty());
  EXPECT_THAT(before.PageHashes(), IsEmpty());
  Store after = Store::CreateOrContinue(folder / "run", SomeRun());
  after.AddPlan({{"take_bottle", "real", "visual_pick", "good", 20}});
  EXPECT_EQ(after.Plan().size(), 1u);
}

}  // namespace
}  // namespace evac
