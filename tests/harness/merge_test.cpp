#include "harness/merge.h"

#include <gtest/gtest.h>

#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

/// A run of two episodes from one initial state, and an empty one to take them into.
class TakenEpisodes : public testing::Test {
 protected:
  TakenEpisodes() {
    for (Store* store : {&from_, &to_}) samples::Declare(*store);
    for (const EpisodeKey& key : {first_, second_}) {
      from_.Add(samples::SomeEpisode(from_, key));
      from_.AddInitialScene(key.pair, Scene());
    }
  }

  static InitialScene Scene() {
    SplitMix64 random(9);
    return {{samples::Image(5), samples::Image(6)}, samples::SomeArms(random), samples::SomeTask().cameras};
  }

  int Take(const EpisodeKey& wanted) {
    return TakeEpisodes(from_, [&](const EpisodeKey& key) { return key == wanted; }, to_);
  }

  const TempFolder folder_;
  const EpisodeKey first_ = samples::Key(1, "real"), second_ = samples::Key(2, "real");
  Store from_ = Store::InMemory(folder_ / "from", samples::SomeRun()), to_ = Store::InMemory(folder_ / "to", samples::SomeRun());
};

TEST_F(TakenEpisodes, BringTheSceneTheyBeganInAlsoWhereAnotherEpisodeOwnsIt) {
  ASSERT_EQ(from_.InitialScenes(), std::vector<PairKey>{first_.pair}) << "the first of the two owns it";
  EXPECT_EQ(Take(second_), 1);
  const auto scene = to_.LoadInitialScene("take_bottle", second_.pair.initial_state);
  ASSERT_TRUE(scene);
  EXPECT_EQ(cv::norm(scene->images.at(1), Scene().images[1], cv::NORM_INF), 0);
}

TEST_F(TakenEpisodes, BringTheirSceneAlsoWhereTheyAreThereWithoutIt) {
  to_.Add(samples::SomeEpisode(to_, second_));
  EXPECT_EQ(Take(second_), 0);
  EXPECT_TRUE(to_.LoadInitialScene("take_bottle", second_.pair.initial_state)) << "an earlier evac left it behind";
}

TEST_F(TakenEpisodes, BringNoSceneOfAStateThatNobodyWants) {
  EpisodeKey elsewhere = first_;
  elsewhere.pair.initial_state = "41-0008";
  EXPECT_EQ(Take(elsewhere), 0);
  EXPECT_TRUE(to_.InitialScenes().empty());
}

}  // namespace
}  // namespace evac
