#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
#include "core/store.h"
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

}  // namespace
}  // namespace evac
