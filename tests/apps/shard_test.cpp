#include <fmt/format.h>
#include <gtest/gtest.h>

#include <set>

#include "apps/evaluate.h"

namespace evac {
namespace {

PairKey Pair(int state, std::uint64_t seed, const std::string& policy = "visual_pick") {
  return {"take_bottle", fmt::format("41-{:04d}", state), policy, "good", seed};
}

/// The one of four that holds it.
int PartOf(const PairKey& pair) {
  std::set<int> parts;
  for (int number = 1; number <= 4; ++number) {
    if (Shard{number, 4}.Holds(pair)) parts.insert(number);
  }
  EXPECT_EQ(parts.size(), 1u);
  return parts.empty() ? 0 : *parts.begin();
}

TEST(Shard, AStatesRepeatsStayTogetherBecauseAllAreImaginedFromTheFirstFrameOfTheLowestSeed) {
  for (int state = 0; state < 40; ++state) {
    for (std::uint64_t seed = 2; seed < 6; ++seed) EXPECT_EQ(PartOf(Pair(state, seed)), PartOf(Pair(state, 1))) << state;
  }
}

TEST(Shard, EveryPartHasSomeStatesAndPoliciesArePartedTooSoThatNoPartHasAllOfOne) {
  std::set<int> parts_of_states, parts_of_policies;
  for (int i = 0; i < 40; ++i) {
    parts_of_states.insert(PartOf(Pair(i, 1)));
    parts_of_policies.insert(PartOf(Pair(0, 1, fmt::format("policy{}", i))));
  }
  EXPECT_EQ(parts_of_states.size(), 4u);
  EXPECT_EQ(parts_of_policies.size(), 4u);
}

TEST(Shard, IsSaidAsItIsAskedForAndNotAtAllWhereItIsTheWhole) {
  EXPECT_EQ((Shard{2, 4}.Option()), " --shard 2/4");
  EXPECT_EQ(Shard{}.Option(), "");
}

}  // namespace
}  // namespace evac
