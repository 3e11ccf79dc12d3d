#include "policies/swaying_policy.h"

#include <Eigen/Geometry>
#include <cmath>

#include "core/error.h"
#include "core/seed.h"
#include "policies/gripper_poses.h"

namespace evac {
namespace {

constexpr double kMost_m = 0.1;
constexpr double kBetweenKnots_m = 0.1;  // of the way: from one independent error to the next
constexpr double kTurn_radpm = 10;

using Strayed = Eigen::Matrix<double, 6, 1>;

/// Standard normal; none where the way begins.
Strayed Knot(std::uint64_t seed, std::uint64_t number) {
  Strayed error = Strayed::Zero();
  if (number == 0) return error;
  SplitMix64 random(SeedFor(SeedFor(seed, "sway"), number));
  for (double& value : error) value = random.Normal();
  return error;
}

/// From knot to knot, at rest in each.
Strayed ErrorAt(std::uint64_t seed, double length_m) {
  const double knots = length_m / kBetweenKnots_m, before = std::floor(knots), s = knots - before;
  const auto number = static_cast<std::uint64_t>(before);
  const double share = s * s * (3 - 2 * s);
  return (1 - share) * Knot(seed, number) + share * Knot(seed, number + 1);
}

}  // namespace

SwayingPolicy::SwayingPolicy(std::unique_ptr<Policy> policy, double sway_m) : policy_(std::move(policy)), sway_m_(sway_m) {
  if (!(sway_m >= 0 && sway_m <= kMost_m)) throw InvalidInput("sway_m is {}, wanted a number from 0 to {}", sway_m, kMost_m);
}

void SwayingPolicy::Reset(SceneId scene, const Task& task, std::uint64_t seed) {
  policy_->Reset(scene, task, seed);
  ways_[scene] = {seed, task.workspace_m, std::nullopt, 0};
}

std::vector<Acted> SwayingPolicy::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers = policy_->Act(batch);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    auto* chunk = std::get_if<ActionChunk>(&answers[i]);
    if (!chunk) continue;
    Way& way = ways_.at(batch[i].scene);
    if (!way.meant_m) way.meant_m = batch[i].observation->arms.back().base_from_gripper.translation();
    for (Arms& arms : chunk->targets) Stray(way, arms.back());
  }
  return answers;
}

void SwayingPolicy::Stray(Way& way, ArmState& hand) const {
  Eigen::Isometry3d& pose = hand.base_from_gripper;
  way.length_m += (pose.translation() - *way.meant_m).norm();
  way.meant_m = pose.translation();
  const Strayed strayed = sway_m_ * ErrorAt(way.seed, way.length_m);
  const Eigen::Vector3d turn_rad = kTurn_radpm * strayed.tail<3>();
  pose.translation() += strayed.head<3>();
  if (turn_rad.norm() > 0) pose.linear() = Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()).toRotationMatrix() * pose.linear();
  pose = Inside(pose, way.workspace_m);
}

}  // namespace evac
