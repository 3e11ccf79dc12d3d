#include "judges/rating_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

namespace evac {
namespace {

/// `states` initial states, each with a clip of every group.
std::vector<OrderedClip> Clips(int states, int groups) {
  std::vector<OrderedClip> clips;
  for (int state = 0; state < states; ++state) {
    for (int group = 0; group < groups; ++group) clips.push_back({std::to_string(state), std::to_string(group), 0});
  }
  return clips;
}

std::size_t Closest(const std::vector<std::size_t>& order, const std::vector<OrderedClip>& clips) {
  std::map<std::string, std::size_t> last;
  std::size_t closest = order.size();
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::string& start = clips[order[i]].start;
    if (last.contains(start)) closest = std::min(closest, i - last[start]);
    last[start] = i;
  }
  return closest;
}

class Orders : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(Orders, HoldEveryClipOnceKeepStartsApartAndBalanceBlocks) {
  const auto [states, groups] = GetParam();
  const std::vector<OrderedClip> clips = Clips(states, groups);
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    for (std::uint64_t rater = 1; rater <= 5; ++rater) {
      const auto order = OrderFor(seed, rater, clips);
      EXPECT_EQ(std::set<std::size_t>(order.begin(), order.end()).size(), clips.size());
      ASSERT_EQ(order.size(), clips.size());
      EXPECT_GT(Closest(order, clips), 12u) << "seed " << seed << ", rater " << rater;
      for (std::size_t block = 0; block + 20 <= order.size(); block += 20) {
        std::map<std::string, int> in_block;
        for (std::size_t i = block; i < block + 20; ++i) ++in_block[clips[order[i]].group];
        const double most = block + 40 <= order.size() ? 2.01 : 4.01;  // the last block takes what is left
        for (const auto& [group, count] : in_block) EXPECT_NEAR(count, 20.0 / groups, most) << "block at " << block;
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Sizes, Orders,
                         testing::Values(std::pair{40, 2}, std::pair{40, 4}, std::pair{20, 8}, std::pair{70, 3}));

TEST(Order, IsAFunctionOfSeedAndRaterAlone) {
  const auto clips = Clips(20, 4);
  EXPECT_EQ(OrderFor(7, 3, clips), OrderFor(7, 3, clips));
  EXPECT_NE(OrderFor(7, 3, clips), OrderFor(7, 4, clips));
  EXPECT_NE(OrderFor(7, 3, clips), OrderFor(8, 3, clips));
}

TEST(Order, ClipsWithFewerVotesComeFirst) {
  auto clips = Clips(30, 2);
  for (std::size_t i = 0; i < clips.size(); ++i) clips[i].votes = static_cast<std::int64_t>(i % 3);
  const auto order = OrderFor(1, 1, clips);
  EXPECT_TRUE(std::ranges::is_sorted(order, {}, [&](std::size_t i) { return clips[i].votes; }));
}

TEST(Order, TooFewStartsAreSpreadAsFarAsTheyGo) {
  const auto clips = Clips(3, 8);
  EXPECT_GE(Closest(OrderFor(1, 1, clips), clips), 2u);
  EXPECT_EQ(OrderFor(1, 1, Clips(1, 5)).size(), 5u);
  EXPECT_TRUE(OrderFor(1, 1, {}).empty());
}

TEST(Repeats, ComeLaterThanTheirFirstAndNeverTwice) {
  std::vector<std::size_t> order(80);
  std::iota(order.begin(), order.end(), 0);
  for (std::uint64_t rater = 1; rater <= 20; ++rater) {
    const auto places = WithRepeats(5, rater, order, 10);
    ASSERT_EQ(places.size(), 90u);
    std::map<std::size_t, std::size_t> first;
    std::set<std::size_t> repeated;
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (!places[i].is_repeat) {
        first[places[i].clip] = i;
        continue;
      }
      ASSERT_TRUE(first.contains(places[i].clip)) << "a repeat before its first";
      EXPECT_GT(i - first[places[i].clip], 12u);
      EXPECT_TRUE(repeated.insert(places[i].clip).second);
    }
    EXPECT_EQ(repeated.size(), 10u);
  }
}

}  // namespace
}  // namespace evac
