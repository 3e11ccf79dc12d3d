#include "core/seed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace evac {
namespace {

TEST(SplitMix64, ItsFirstNumbersAreThePublishedOnes) {
  EXPECT_EQ(SplitMix64(0).Next(), 0xE220A8397B1DCDAFULL);
  SplitMix64 random(1234567);
  for (const std::uint64_t wanted :
       {6457827717110365317ULL, 3203168211198807973ULL, 9817491932198370423ULL, 4593380528125082431ULL}) {
    EXPECT_EQ(random.Next(), wanted);
  }
}

TEST(SplitMix64, BelowReachesEveryValueEquallyOftenAndNoOther) {
  SplitMix64 random(3);
  int counts[7] = {};
  for (int i = 0; i < 70000; ++i) {
    const std::uint64_t value = random.Below(7);
    ASSERT_LT(value, 7u);
    ++counts[value];
  }
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);  // four standard deviations
  EXPECT_EQ(random.Below(1), 0u);
}

TEST(SplitMix64, UniformFillsItsIntervalAndNormalHasItsMoments) {
  SplitMix64 random(4);
  double sum = 0, sum_of_squares = 0, low = 1, high = 0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double uniform = random.Uniform();
    low = std::min(low, uniform);
    high = std::max(high, uniform);
    const double normal = random.Normal();
    ASSERT_TRUE(std::isfinite(normal));
    sum += normal;
    sum_of_squares += normal * normal;
    const double between = random.Uniform(-3, 2);
    ASSERT_TRUE(between >= -3 && between < 2);
  }
  EXPECT_GE(low, 0);
  EXPECT_LT(low, 1e-3);
  EXPECT_LT(high, 1);
  EXPECT_GT(high, 1 - 1e-3);
  EXPECT_NEAR(sum / kCount, 0, 0.015);
  EXPECT_NEAR(sum_of_squares / kCount, 1, 0.02);
}

TEST(SeedFor, StreamsOfOtherPurposesSeedsAndPlacesAreOthers) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (const char* purpose : {"", "camera noise", "camera noisf", "noise camera"})
      seeds.insert(SeedFor(seed, purpose));
    for (std::uint64_t index = 0; index < 50; ++index) seeds.insert(SeedFor(seed, index));
  }
  EXPECT_EQ(seeds.size(), 50u * 54u);
}

TEST(SeedFor, IsTheSameInEveryVersion) {  // stored runs are repeated by it
  EXPECT_EQ(SeedFor(41, "camera noise"), 7701245077481760667ULL);
  EXPECT_EQ(SeedFor(41, std::uint64_t{7}), 7801683639763652718ULL);
}

}  // namespace
}  // namespace evac
