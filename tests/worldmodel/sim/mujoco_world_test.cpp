#include "worldmodel/sim/mujoco_world.h"

#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "judges/oracle_judge.h"
#include "tests/support/temp_folder.h"
#include "tests/worldmodel/sim/scripted_pick.h"
#include "tests/worldmodel/sim/sim_test_support.h"

namespace evac::test {
namespace {

using sim::MujocoWorld;
using ::testing::HasSubstr;

/// A motion that touches nothing: a small circle at height.
std::vector<Arms> Circle(const ArmState& start, int periods, double radius_m = 0.05) {
  std::vector<Arms> targets;
  for (int k = 1; k <= periods; ++k) {
    ArmState arm = start;
    arm.base_from_gripper.translation() += radius_m * Eigen::Vector3d(std::sin(0.3 * k), 1 - std::cos(0.3 * k), 0);
    arm.closure = 0.5;
    targets.push_back({arm});
  }
  return targets;
}

/// x, y, z of everything that can be moved, in the order of names.
std::vector<double> ThingPositions(const PrivilegedFrame& frame) {
  std::vector<double> numbers;
  for (const auto& body : frame.bodies) {
    if (body.name.find("gripper") != std::string::npos || body.name.find("finger") != std::string::npos) continue;
    const Eigen::Vector3d at_m = body.base_from_body.translation();
    numbers.insert(numbers.end(), at_m.begin(), at_m.end());
  }
  return numbers;
}

std::string Complaint(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "no complaint";
}

TEST(MujocoWorld, TheFirstObservationIsWhatTheTaskDeclares) {
  MujocoWorld world = MakeWorld("real");
  for (const std::string id : {"take_bottle", "take_toast"}) {
    const Task task = ReadTask(id);
    const WorldStep first = world.Reset(0, task, State(1), 1);
    EXPECT_EQ(WhatIsWrong(first.observation, task), std::nullopt);
    EXPECT_FALSE(first.observation.arms_are_commanded);
    EXPECT_NEAR((first.observation.arms[0].base_from_gripper.translation() - Eigen::Vector3d(0.30, 0, 0.30)).norm(), 0,
                0.003);
    EXPECT_LT(first.observation.arms[0].closure, 0.05);
  }
}

/// The pages that are shipped: whoever adds one gets this test for it.
std::vector<std::filesystem::path> TaskPages() {
  std::vector<std::filesystem::path> pages;
  for (const auto& entry : std::filesystem::directory_iterator(SceneFolder())) {
    if (entry.path().extension() == ".yaml") pages.push_back(entry.path());
  }
  std::sort(pages.begin(), pages.end());
  return pages;
}

class EveryPage : public ::testing::TestWithParam<std::filesystem::path> {};
INSTANTIATE_TEST_SUITE_P(Scenes, EveryPage, ::testing::ValuesIn(TaskPages()),
                         [](const auto& info) { return info.param.stem().string(); });

TEST_P(EveryPage, StartsInAHundredDifferentStatesThatStandStillAndShowWhatItDeclares) {
  MujocoWorld world = MakeWorld("real");
  const Task task = WithTinyPictures(ReadTaskPage(GetParam()));
  EXPECT_EQ(task.id, GetParam().stem().string());
  std::set<std::string> states;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const WorldStep first = world.Reset(0, task, State(seed), 1);
    EXPECT_EQ(WhatIsWrong(first.observation, task), std::nullopt) << seed;
    EXPECT_EQ(WhatIsWrong(task.rubric, first.privileged), std::nullopt);
    states.insert(fmt::format("{:.4f}", fmt::join(ThingPositions(first.privileged), " ")));
  }
  EXPECT_EQ(states.size(), 100U);
}

TEST_P(EveryPage, ThingsThatNobodyTouchesStayWhereTheyAre) {
  MujocoWorld world = MakeWorld("real");
  const Task task = WithTinyPictures(ReadTaskPage(GetParam()));
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const WorldStep first = world.Reset(0, task, State(seed), 1);
    const auto steps = Advance(world, 0, std::vector<Arms>(30, first.observation.arms));
    const auto before = ThingPositions(first.privileged), after = ThingPositions(steps.back().privileged);
    for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(before[i], after[i], 0.004) << seed << " " << i;
  }
}

TEST(MujocoWorld, PicturesHaveTheSizeOfTheTasksCameras) {
  MujocoWorld world = MakeWorld("sim");
  Task task = ReadTask("take_bottle");
  task.cameras[0] = Resized(task.cameras[0], 192, 128);
  const auto images = world.Reset(0, task, State(1), 1).observation.images;
  EXPECT_EQ(images[0].size(), cv::Size(192, 128));
  EXPECT_EQ(images[1].size(), cv::Size(96, 64));
  EXPECT_EQ(images[0].type(), CV_8UC3);
}

TEST(MujocoWorld, TheArmGoesWhereItIsTold) {
  MujocoWorld world = MakeWorld("sim");
  const Task task = WithTinyPictures(ReadTask("take_bottle"));
  const ArmState home = world.Reset(0, task, State(1), 1).observation.arms[0];
  const ArmState goal = At({0.5, 0.2, 0.25}, Downward(Eigen::Vector3d(0.5, -1, 0), 0.3), 0.7);
  const ArmState end = Advance(world, 0, Targets(home, {{goal, 20}, {goal, 5}})).back().observation.arms[0];
  EXPECT_LT((end.base_from_gripper.translation() - goal.base_from_gripper.translation()).norm(), 0.001);
  EXPECT_LT(RotationBetween(end.base_from_gripper, goal.base_from_gripper), 0.005);
  EXPECT_NEAR(end.closure, 0.7, 0.01);
}

TEST(MujocoWorld, ATargetOutOfReachIsFollowedAsFarAsItGoes) {
  MujocoWorld world = MakeWorld("real");
  const Task task = WithTinyPictures(ReadTask("take_bottle"));
  const ArmState home = world.Reset(0, task, State(1), 1).observation.arms[0];
  const auto steps = Advance(world, 0, std::vector<Arms>(30, {At({2, 2, 0.3}, home.base_from_gripper.linear(), 0)}));
  EXPECT_EQ(WhatIsWrong(steps.back().observation, task), std::nullopt);
  EXPECT_GT(steps.back().observation.arms[0].base_from_gripper.translation().head<2>().norm(), 0.6);
}

TEST(MujocoWorld, TheSameSeedGivesTheSameBytesInAnotherProcesssPlace) {
  const Task task = ReadTask("take_toast");
  std::string bytes[2];
  for (std::string& here : bytes) {
    MujocoWorld world = MakeWorld("real");
    const WorldStep first = world.Reset(0, task, State(5), 2);
    here = Bytes(first) + Bytes(Advance(world, 0, Circle(first.observation.arms[0], 6)));
  }
  EXPECT_TRUE(bytes[0] == bytes[1]);
}

TEST(MujocoWorld, AnEpisodeDoesNotDependOnLanesThreadsCompanyOrOrder) {
  const Task bottle = ReadTask("take_bottle"), toast = ReadTask("take_toast");
  MujocoWorld alone = MakeWorld("real", 1);
  const WorldStep first = alone.Reset(0, bottle, State(9), 3);
  const std::vector<Arms> targets = Circle(first.observation.arms[0], 8);
  const std::string expected = Bytes(first) + Bytes(Advance(alone, 0, targets));

  MujocoWorld crowd = MakeWorld("real", 3);
  crowd.Reset(4, toast, State(1), 1);
  crowd.Reset(2, bottle, State(2), 3);
  const std::string crowd_first = Bytes(crowd.Reset(7, bottle, State(9), 3));
  const ActionChunk others{Circle(first.observation.arms[0], 5, 0.02), false};
  const ActionChunk begin{{targets.begin(), targets.begin() + 3}, false},
      rest{{targets.begin() + 3, targets.end()}, false};
  const SceneChunk one[] = {{4, &others}, {7, &begin}, {2, &others}}, two[] = {{7, &rest}, {2, &others}};
  const auto begun = crowd.Advance(one), ended = crowd.Advance(two);
  EXPECT_TRUE(expected == crowd_first + Bytes(std::get<0>(begun[1])) + Bytes(std::get<0>(ended[0])));
}

TEST(MujocoWorld, WhatNobodyIsShownIsNotDrawnAndChangesNothingElse) {
  const Task task = ReadTask("take_toast");
  MujocoWorld filmed = MakeWorld("real"), unfilmed({.name = "real", .profile = ProfilePage("real"), .threads = 1, .film = false});
  const WorldStep first = filmed.Reset(0, task, State(5), 2);
  EXPECT_TRUE(Bytes(first) == Bytes(unfilmed.Reset(0, task, State(5), 2)));
  const std::vector<Arms> targets = Circle(first.observation.arms[0], 8);
  for (std::size_t from = 0; from < targets.size(); from += 4) {
    const std::vector<Arms> chunk(targets.begin() + from, targets.begin() + from + 4);
    std::vector<WorldStep> seen = Advance(filmed, 0, chunk);
    const std::vector<WorldStep> unseen = Advance(unfilmed, 0, chunk);
    ASSERT_EQ(unseen.size(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(ThingPositions(seen[k].privileged), ThingPositions(unseen[k].privileged));
      if (k < 3) seen[k].observation.images.clear();
      EXPECT_EQ(unseen[k].observation.images.size(), seen[k].observation.images.size());
      EXPECT_TRUE(Bytes(seen[k]) == Bytes(unseen[k])) << "step " << from + k;
    }
  }
}

TEST(MujocoWorld, AnInitialStateIsTheSameInBothProfilesUpToTheirDifferences) {
  MujocoWorld real = MakeWorld("real"), simulated = MakeWorld("sim");
  const Task task = ReadTask("take_bottle");
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const WorldStep a = real.Reset(0, task, State(seed), 1), b = simulated.Reset(0, task, State(seed), 1);
    for (const auto& body : a.privileged.bodies) {
      if (body.name != "box" && body.name != "bottle") continue;
      EXPECT_LT((body.base_from_body.translation() - PoseIn(b.privileged, body.name).translation()).norm(), 0.001)
          << body.name;
    }
    cv::Mat difference;
    cv::absdiff(a.observation.images[0], b.observation.images[0], difference);
    const cv::Scalar mean = cv::mean(difference);
    EXPECT_LT(mean[0] + mean[1] + mean[2], 60);  // a little light, noise and half a pixel: the same scene
    EXPECT_GT(mean[0] + mean[1] + mean[2], 1);   // but not the same picture
  }
}

TEST(MujocoWorld, OtherStatesLookOtherwise) {
  MujocoWorld world = MakeWorld("sim");
  const Task task = ReadTask("take_bottle");
  const WorldStep a = world.Reset(0, task, State(1), 1), b = world.Reset(0, task, State(2), 1);
  EXPECT_GT((PoseIn(a.privileged, "bottle").translation() - PoseIn(b.privileged, "bottle").translation()).norm(),
            0.005);
  EXPECT_GT(cv::norm(a.observation.images[0], b.observation.images[0], cv::NORM_L1) / (64 * 96 * 3), 2);
}

TEST(MujocoWorld, TheSeedOfTheWorldIsTheSensorsNoiseAndNothingElse) {
  MujocoWorld world = MakeWorld("real");
  const Task task = ReadTask("take_bottle");
  const WorldStep a = world.Reset(0, task, State(1), 1), b = world.Reset(0, task, State(1), 2);
  for (const auto& body : a.privileged.bodies)
    EXPECT_TRUE(body.base_from_body.isApprox(PoseIn(b.privileged, body.name), 0)) << body.name;
  cv::Mat difference;
  cv::subtract(a.observation.images[0], b.observation.images[0], difference, cv::noArray(), CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(difference, mean, deviation);
  EXPECT_NEAR(deviation[1], std::sqrt(2.0) * world.profile().sensors.image_noise, 0.3);
  EXPECT_FALSE(a.observation.arms[0].base_from_gripper.isApprox(b.observation.arms[0].base_from_gripper, 1e-9));

  MujocoWorld clean = MakeWorld("sim");
  EXPECT_TRUE(Bytes(clean.Reset(0, task, State(1), 1)) == Bytes(clean.Reset(0, task, State(1), 2)));
}

TEST(MujocoWorld, AGreenBottleIsWhereTheCalibratedCamerasSayItIs) {
  MujocoWorld world = MakeWorld("sim");
  const Task task = ReadTask("take_bottle");
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const WorldStep first = world.Reset(0, task, State(seed), 1);
    const Eigen::Vector3d shoulder_m = PoseIn(first.privileged, "bottle") * Eigen::Vector3d(0, 0, 0.115);
    const Eigen::Isometry3d base_from_camera = BaseFromCamera(task.cameras[0], first.observation.arms);
    const Eigen::Vector2d pixel = Project(task.cameras[0], base_from_camera.inverse() * shoulder_m).value();
    const auto rgb =
        first.observation.images[0].at<cv::Vec3b>(static_cast<int>(pixel.y()), static_cast<int>(pixel.x()));
    EXPECT_GT(rgb[1], rgb[0] + 30) << seed;
    EXPECT_GT(rgb[1], rgb[2] + 20) << seed;
  }
}

/// The bottle's task in a scene with a pendulum that is driven instead of damped: within two seconds no number is
/// finite. Its files are written into the folder.
Task TaskThatBlowsUp(const std::filesystem::path& folder) {
  const std::filesystem::path scenes = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes";
  std::string scene = ReadFile(scenes / "take_bottle.xml");
  scene.insert(scene.find("</worldbody>"),
               R"(<body pos="0 0 -2"><inertial pos="0.1 0 0" mass="0.1" diaginertia="0.001 0.001 0.001"/>
    <joint type="hinge" axis="0 1 0" damping="-0.06"/></body>)");
  WriteFileAtomically(folder / "take_bottle.xml", scene);
  WriteFileAtomically(folder / "robot.xml", ReadFile(scenes / "robot.xml"));
  return ParseTaskPage(ReadFile(scenes / "take_bottle.yaml"), folder / "take_bottle.yaml");
}

TEST(MujocoWorld, PhysicsThatDivergesFailsItsOwnSceneOnly) {
  const TempFolder folder;
  MujocoWorld world = MakeWorld("sim", 2);
  const Task bad = WithTinyPictures(TaskThatBlowsUp(folder.path())), good = WithTinyPictures(ReadTask("take_bottle"));
  const ArmState home = world.Reset(0, bad, State(1), 1).observation.arms[0];
  world.Reset(1, good, State(1), 1);
  const ActionChunk rest{std::vector<Arms>(20, {home}), false};
  const SceneChunk batch[] = {{0, &rest}, {1, &rest}};
  const auto answers = world.Advance(batch);
  ASSERT_TRUE(std::holds_alternative<Failure>(answers[0]));
  EXPECT_EQ(std::get<Failure>(answers[0]).stop, StopReason::kDiverged);
  EXPECT_THAT(std::get<Failure>(answers[0]).message, HasSubstr("diverged"));
  EXPECT_EQ(std::get<0>(answers[1]).size(), 20U);
  EXPECT_EQ(WhatIsWrong(world.Reset(0, good, State(1), 1).observation, good),
            std::nullopt);  // the lane can be used again
}

/// Ends what draws for this process's worlds.
void EndDrawingProcesses() {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "stat");
    std::string pid, name, state, parent;
    file >> pid >> name >> state >> parent;
    if (name == "(evac-draw)" && parent == std::to_string(::getpid())) ::kill(std::stoi(pid), SIGKILL);
  }
}

TEST(MujocoWorld, ASceneThatCannotBeDrawnLeavesTheOthersTheirAnswers) {
  const TempFolder folder;
  MujocoWorld world({"sim", ProfilePage("sim"), 1, /*film=*/false});
  const Task bad = WithTinyPictures(TaskThatBlowsUp(folder.path())), good = WithTinyPictures(ReadTask("take_bottle"));
  const ArmState home = world.Reset(0, good, State(1), 1).observation.arms[0];
  world.Reset(1, bad, State(1), 1);  // never comes to be drawn
  const ActionChunk rest{std::vector<Arms>(20, {home}), false};
  const SceneChunk batch[] = {{0, &rest}, {1, &rest}};
  rlimit descriptors{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &descriptors), 0);
  const rlimit none_left{1, descriptors.rlim_max};
  EndDrawingProcesses();
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none_left), 0);  // no other can be started
  std::vector<Advanced> answers;
  EXPECT_NO_THROW(answers = world.Advance(batch));
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &descriptors), 0);
  ASSERT_EQ(answers.size(), 2U);
  ASSERT_TRUE(std::holds_alternative<Failure>(answers[0]) && std::holds_alternative<Failure>(answers[1]));
  EXPECT_EQ(std::get<Failure>(answers[0]).stop, StopReason::kWorldError);
  EXPECT_THAT(std::get<Failure>(answers[0]).message, HasSubstr("cannot render"));
  EXPECT_EQ(std::get<Failure>(answers[1]).stop, StopReason::kDiverged);
}

TEST(MujocoWorld, WhatItCannotShowIsRefusedByName) {
  MujocoWorld world = MakeWorld("sim");
  const auto complaint_about = [&](const Task& task) { return Complaint([&] { world.Reset(0, task, State(1), 1); }); };
  Task stretched = ReadTask("take_bottle");
  stretched.cameras[1] = Resized(stretched.cameras[1], 96, 96);
  EXPECT_THAT(complaint_about(stretched), HasSubstr("hand_right"));
  Task shifted = ReadTask("take_bottle");
  shifted.cameras[0].cx_px += 3;
  EXPECT_THAT(complaint_about(shifted), HasSubstr("principal point"));
  Task two_arms = ReadTask("take_bottle");
  two_arms.arms = {"left", "right"};
  EXPECT_THAT(complaint_about(two_arms), HasSubstr("[right]"));
  Task recorded = ReadTask("take_bottle");
  recorded.page = recorded.page.substr(0, recorded.page.find("\nmujoco:"));
  EXPECT_THAT(complaint_about(recorded), HasSubstr("mujoco"));
  Task misspelt = ReadTask("take_bottle");
  misspelt.page.replace(misspelt.page.find("body: bottle"), 12, "body: flask ");
  EXPECT_THAT(complaint_about(misspelt), HasSubstr("flask"));
  Task unturned = ReadTask("take_bottle");
  unturned.page.replace(unturned.page.find("quat_xyzw: [1, 0, 0, 0]"), 23, "quat_xyzw: [0, 0, 0, 0]");
  EXPECT_THAT(complaint_about(unturned), HasSubstr("quat_xyzw"));
  Task nowhere = ReadTask("take_bottle");
  nowhere.page.replace(nowhere.page.find("position_m: [0.30, 0.0"), 22, "position_m: [.nan, 0.0");
  EXPECT_THAT(complaint_about(nowhere), HasSubstr("position_m"));
  Task scattered = ReadTask("take_bottle");
  scattered.page.replace(scattered.page.find("bodies: [clutter_mug"), 20, "bodies: [bottle");
  EXPECT_THAT(complaint_about(scattered), HasSubstr("clutter 'bottle' is free to move"));
  Task unnamed = ReadTask("take_bottle");
  unnamed.page.replace(unnamed.page.find("includes: [robot.xml]"), 21, "includes: []");
  EXPECT_THAT(complaint_about(unnamed), HasSubstr("robot.xml"));
}

}  // namespace
}  // namespace evac::test
