#include "policies/swaying_policy.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/geometry.h"
#include "core/task_page.h"

namespace evac {
namespace {

/// Sends the right hand along y by `step_m` at a time, `moving` steps far, and then tells it to stay.
class Straight final : public Policy {
 public:
  Straight(int moving, double step_m) : moving_(moving), step_m_(step_m) {}
  std::string Name() const override { return "straight"; }
  void Reset(SceneId, const Task&, std::uint64_t) override { told_ = 0; }
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::vector<Acted> answers;
    for (const SceneObservation& asked : batch) {
      ActionChunk chunk;
      for (int k = 0; k < 10; ++k) {
        Arms arms = asked.observation->arms;
        told_ = std::min(told_ + 1, moving_);
        arms.back().base_from_gripper.translation().y() += told_ * step_m_;
        chunk.targets.push_back(arms);
      }
      answers.push_back(chunk);
    }
    return answers;
  }

 private:
  int moving_, told_ = 0;
  double step_m_;
};

Observation Start() {
  Observation observation;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(0.4, -0.1, 0.25);
  observation.arms = {{Eigen::Isometry3d::Identity(), 0}, {pose, 0.5}};
  return observation;
}

/// What is told in an episode of thirty steps, twenty of which move 1 cm.
std::vector<Arms> Told(double sway_m, std::uint64_t seed) {
  SwayingPolicy policy(std::make_unique<Straight>(20, 0.01), sway_m);
  policy.Reset(3, ReadTaskPage(EVAC_SOURCE_DIR "/worldmodel/sim/scenes/take_bottle.yaml"), seed);
  const Observation start = Start();
  const SceneObservation asked{3, &start};
  std::vector<Arms> told;
  for (int chunk = 0; chunk < 3; ++chunk) {
    const std::vector<Acted> answers = policy.Act({&asked, 1});
    const auto& targets = std::get<ActionChunk>(answers.front()).targets;
    told.insert(told.end(), targets.begin(), targets.end());
  }
  return told;
}

Eigen::Vector3d Strayed_m(const std::vector<Arms>& told, const std::vector<Arms>& meant, std::size_t k) {
  return told[k].back().base_from_gripper.translation() - meant[k].back().base_from_gripper.translation();
}

TEST(SwayingPolicy, StraysAsFarAsItIsToldAndFromNothingOn) {
  const std::vector<Arms> meant = Told(0, 1);
  constexpr int kSeeds = 400;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const std::vector<Arms> told = Told(0.01, seed);
    EXPECT_LT(Strayed_m(told, meant, 0).norm(), 0.003) << "a tenth of the way to the first knot";
    squares += Strayed_m(told, meant, 9).cwiseAbs2();  // .1 m on its way: a knot
  }
  for (const double square : squares) EXPECT_NEAR(std::sqrt(square / kSeeds), 0.01, 0.0015);
}

TEST(SwayingPolicy, IsSmoothAndWhereItIsToldToStayItStays) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const std::vector<Arms> told = Told(0.01, seed), meant = Told(0, seed);
    for (std::size_t k = 1; k < told.size(); ++k)
      EXPECT_LT((Strayed_m(told, meant, k) - Strayed_m(told, meant, k - 1)).norm(), 0.015) << "step " << k;
    for (std::size_t k = 20; k < told.size(); ++k) {
      EXPECT_TRUE(told[k].back().base_from_gripper.isApprox(told[19].back().base_from_gripper, 1e-9)) << "it moves no more";
    }
  }
}

TEST(SwayingPolicy, TurnsTheHandAndLeavesTheOtherArmAndTheFingersAlone) {
  const std::vector<Arms> told = Told(0.01, 4), meant = Told(0, 4);
  EXPECT_GT(RotationBetween(told[9].back().base_from_gripper, meant[9].back().base_from_gripper), 0.01);
  for (std::size_t k = 0; k < told.size(); ++k) {
    EXPECT_TRUE(told[k].front().base_from_gripper.isApprox(meant[k].front().base_from_gripper));
    EXPECT_EQ(told[k].back().closure, meant[k].back().closure);
    EXPECT_NEAR(told[k].back().base_from_gripper.linear().determinant(), 1, 1e-9);
  }
}

TEST(SwayingPolicy, IsAFunctionOfItsSeed) {
  const std::vector<Arms> one = Told(0.01, 7), same = Told(0.01, 7), other = Told(0.01, 8);
  EXPECT_TRUE(one[15].back().base_from_gripper.isApprox(same[15].back().base_from_gripper, 0));
  EXPECT_FALSE(one[15].back().base_from_gripper.isApprox(other[15].back().base_from_gripper, 1e-6));
}

TEST(SwayingPolicy, RefusesToStrayFurtherThanAnArmReaches) {
  for (const double sway_m : {-0.01, 0.2, std::nan("")}) EXPECT_THROW(SwayingPolicy(std::make_unique<Straight>(1, 0.01), sway_m), Error);
}

}  // namespace
}  // namespace evac
