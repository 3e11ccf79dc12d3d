#include "apps/variation.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace evac {
namespace {

/// Goes down in a line, closes at frame 20, lifts, opens at 50 elsewhere.
std::vector<Arms> Told(bool closes = true) {
  std::vector<Arms> told;
  for (int t = 0; t < 70; ++t) {
    ArmState hand;
    hand.base_from_gripper.translation() =
        Eigen::Vector3d(0.4 + 0.004 * std::max(0, t - 25), 0.1, t < 25 ? 0.3 - 0.01 * t : 0.05 + 0.005 * (t - 25));
    hand.closure = closes && t >= 20 && t < 50 ? 1 : 0;
    told.push_back({hand});
  }
  return told;
}

double Away_m(const Arms& a, const Arms& b) {
  return (a[0].base_from_gripper.translation() - b[0].base_from_gripper.translation()).norm();
}

bool IsSame(const std::vector<Arms>& a, const std::vector<Arms>& b) {
  for (std::size_t t = 0; t < a.size(); ++t) {
    if (Away_m(a[t], b[t]) > 0 || a[t][0].closure != b[t][0].closure ||
        !a[t][0].base_from_gripper.isApprox(b[t][0].base_from_gripper, 0))
      return false;
  }
  return true;
}

TEST(Variation, ErrsAboutWhereAndWhenAHandClosesAndGoesThereSmoothly) {
  const std::vector<Arms> told = Told();
  int same = 0, elsewhere = 0, earlier = 0, later = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SplitMix64 random(seed);
    const std::vector<Arms> varied = Varied(told, random);
    ASSERT_EQ(varied.size(), told.size());
    EXPECT_TRUE(IsSame({varied[0]}, {told[0]})) << "where the arms were is nobody's choice";
    same += IsSame(varied, told);
    elsewhere += Away_m(varied[20], told[20]) > 1e-9;
    for (std::size_t t = 1; t < told.size(); ++t) {
      EXPECT_LT(Away_m(varied[t], told[t]), 0.08);
      EXPECT_LT(Away_m(varied[t], varied[t - 1]), Away_m(told[t], told[t - 1]) + 0.02) << seed << " " << t;
      EXPECT_TRUE(varied[t][0].closure == 0 || varied[t][0].closure == 1);
    }
    const auto closes = std::ranges::find_if(varied, [](const Arms& arms) { return arms[0].closure > 0; }) - varied.begin();
    EXPECT_GE(closes, 16);
    EXPECT_LE(closes, 24);
    earlier += closes < 20;
    later += closes > 20;
  }
  EXPECT_GT(same, 15);
  EXPECT_LT(same, 60);
  EXPECT_GT(elsewhere, 150);
  EXPECT_GT(earlier, 20);
  EXPECT_GT(later, 20);
}

/// Three draws were arguments of one call, and which came first was the compiler's choice: with another one, other
/// shards.
TEST(Variation, GoesWhereTheOrderOfItsDrawsSays) {
  const std::vector<Arms> told = Told();
  int elsewhere = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    SplitMix64 random(seed), again(seed);
    const std::vector<Arms> varied = Varied(told, random);
    if (again.Uniform() < 0.1) continue;
    again.Below(1);  // of one closing
    const bool wide = again.Uniform() < 0.5;
    const double z_m = (wide ? 0.006 : 0.003) * again.Normal();
    const double y_m = (wide ? 0.012 : 0.004) * again.Normal();
    const double x_m = (wide ? 0.012 : 0.004) * again.Normal();
    const Eigen::Vector3d away_m = again.Uniform() < 0.7 ? Eigen::Vector3d(x_m, y_m, z_m) : Eigen::Vector3d::Zero();
    const Eigen::Vector3d went_m =
        varied[20][0].base_from_gripper.translation() - told[20][0].base_from_gripper.translation();
    EXPECT_LT((went_m - away_m).norm(), 1e-12) << seed;
    elsewhere += away_m.norm() > 0;
  }
  EXPECT_GT(elsewhere, 20);
}

TEST(Variation, IsDecidedByItsSeed) {
  SplitMix64 a(5), b(5), c(6);
  const std::vector<Arms> told = Told(), varied = Varied(told, a);
  EXPECT_TRUE(IsSame(varied, Varied(told, b)));
  EXPECT_FALSE(IsSame(varied, Varied(told, c)));
}

TEST(Variation, OfAHandThatNeverClosesNeverCloses) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    SplitMix64 random(seed);
    for (const Arms& arms : Varied(Told(false), random)) EXPECT_EQ(arms[0].closure, 0);
  }
  SplitMix64 random(1);
  EXPECT_EQ(Varied(std::vector<Arms>(1, Told()[0]), random).size(), 1u);
}

}  // namespace
}  // namespace evac
