#include "policies/explorer.h"

#include <gmock/gmock.h>

#include "core/check.h"
#include "core/error.h"
#include "core/task_page.h"

namespace evac {
namespace {

constexpr Exploration kAll[] = {Exploration::kPush, Exploration::kWrongObject, Exploration::kRoam,
                                Exploration::kRandom};

Task ReadTask(const std::string& name) {
  return ReadTaskPage(EVAC_SOURCE_DIR "/worldmodel/sim/scenes/" + name + ".yaml");
}

/// Grey pictures: nothing is seen, so things are where they usually are.
Observation Start(const Task& task) {
  Observation observation;
  for (const Camera& camera : task.cameras)
    observation.images.emplace_back(camera.height_px, camera.width_px, CV_8UC3, cv::Scalar::all(128));
  Eigen::Isometry3d home = Eigen::Isometry3d::Identity();
  home.translation() = Eigen::Vector3d(0.3, 0, 0.3);
  home.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  observation.arms = {{home, 0}};
  return observation;
}

/// The first `chunks` chunks of an episode, one after the other.
std::vector<Arms> Targets(Exploration does, const Task& task, std::uint64_t seed, int chunks) {
  Explorer explorer({.does = does, .chunk_size = 8});
  explorer.Reset(0, task, seed);
  const Observation observation = Start(task);
  std::vector<Arms> targets;
  for (int i = 0; i < chunks; ++i) {
    const SceneObservation asked{0, &observation};
    const auto chunk = std::get<ActionChunk>(explorer.Act({&asked, 1}).front());
    EXPECT_EQ(WhatIsWrong(chunk, task, 8), std::nullopt);
    targets.insert(targets.end(), chunk.targets.begin(), chunk.targets.end());
  }
  return targets;
}

TEST(Explorer, WhateverItDoesItStaysInTheWorkspaceAndComesToRest) {
  for (const char* name : {"take_bottle", "take_toast", "take_ham", "take_lettuce"}) {
    const Task task = ReadTask(name);
    for (const Exploration does : kAll) {
      for (std::uint64_t seed = 0; seed < 5; ++seed) {
        const std::vector<Arms> targets = Targets(does, task, seed, 30);
        const ArmState &last = targets.back()[0], &before = targets[targets.size() - 9][0];
        EXPECT_TRUE(last.base_from_gripper.isApprox(before.base_from_gripper, 1e-9)) << name << " seed " << seed;
      }
    }
  }
}

TEST(Explorer, TheSameSeedGivesTheSameMotionAndAnotherSeedAnother) {
  const Task task = ReadTask("take_toast");
  for (const Exploration does : kAll) {
    const auto motion = [&](std::uint64_t seed) {
      std::vector<double> numbers;
      for (const Arms& arms : Targets(does, task, seed, 6)) {
        const Eigen::Vector3d at_m = arms[0].base_from_gripper.translation();
        numbers.insert(numbers.end(), {at_m.x(), at_m.y(), at_m.z(), arms[0].closure});
      }
      return numbers;
    };
    EXPECT_EQ(motion(3), motion(3));
    EXPECT_NE(motion(3), motion(4));
  }
}

TEST(Explorer, APushGoesThroughWhereTheThingUsuallyIsAndNotAboveIt) {
  const Task task = ReadTask("take_ham");
  double nearest_m = 1;
  for (const Arms& arms : Targets(Exploration::kPush, task, 1, 12))
    nearest_m =
        std::min(nearest_m, (arms[0].base_from_gripper.translation() - Eigen::Vector3d(0.44, -0.14, 0.03)).norm());
  EXPECT_LT(nearest_m, 0.06);
}

TEST(Explorer, RoamingKeepsAboveEverythingThatStandsThere) {
  const Task task = ReadTask("take_bottle");
  for (const Arms& arms : Targets(Exploration::kRoam, task, 2, 15))
    EXPECT_GE(arms[0].base_from_gripper.translation().z(), 0.19);
}

TEST(Explorer, WhatItCannotDoIsRefused) {
  EXPECT_THROW(ExplorationFromName("dance"), Error);
  EXPECT_THROW(Explorer({.speed = 9}), Error);
  Task unknown = ReadTask("take_ham");
  unknown.id = "take_nap";
  Explorer explorer({});
  EXPECT_THROW(explorer.Reset(0, unknown, 1), Error);
}

}  // namespace
}  // namespace evac
