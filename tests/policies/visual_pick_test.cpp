#include "policies/visual_pick.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "core/check.h"
#include "core/error.h"
#include "core/geometry.h"
#include "tests/policies/visual_support.h"

namespace evac {
namespace {

View ViewOf(const Task& task, const Observation& observation, int camera) {
  return {&observation.images[camera], task.cameras[camera], BaseFromCamera(task.cameras[camera], observation.arms)};
}

constexpr int kHeadStates = 8;

/// Of every initial state: how far from the truth the head camera finds a body, in metres.
struct Sought {
  Thing thing;
  Prior usual;
  std::string body;
};
double WorstHeadError(sim::MujocoWorld& world, const Task& task, const Sought& sought) {
  double worst_m = 0;
  for (int state = 0; state < kHeadStates; ++state) {
    const WorldStep first = world.Reset(0, task, SimState(state), 1);
    const auto fit = Locate(ViewOf(task, first.observation, 0), sought.thing, sought.usual);
    if (!fit) return std::numeric_limits<double>::infinity();
    const Eigen::Vector2d truth_m = PoseIn(first.privileged, sought.body).translation().head<2>();
    worst_m = std::max(worst_m, (fit->placement.xy_m - truth_m).norm());
  }
  return worst_m;
}

/// What the policy knows, by the names that the scenes have for it.
struct KnownTask {
  const char *id, *thing, *target;
};
constexpr KnownTask kKnownTasks[] = {{"take_bottle", "bottle", ""},
                                     {"take_bottle_two_arms", "bottle", ""},
                                     {"take_toast", "toast", "plate"},
                                     {"take_ham", "ham", "bread"},
                                     {"take_lettuce", "leaf", "bowl"}};

class HeadCamera : public testing::TestWithParam<int> {};

TEST_P(HeadCamera, FindsWhatItIsToTakeAndWhereToPutIt) {
  const int width_px = GetParam();
  sim::MujocoWorld world = SimWorld("real");
  for (const KnownTask& known : kKnownTasks) {
    const char* id = known.id;
    Task task = SimTask(id);
    for (Camera& camera : task.cameras) camera = Resized(camera, width_px, width_px * 2 / 3);
    const PickKnowledge knowledge = KnowledgeOf(id);
    EXPECT_LT(WorstHeadError(world, task, {knowledge.thing, knowledge.usual, known.thing}), 0.015) << id;
    if (knowledge.target) {
      EXPECT_LT(WorstHeadError(world, task, {*knowledge.target, knowledge.usual_target, known.target}), 0.015) << id;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Widths, HeadCamera, testing::Values(96, 192));

TEST(VisualPick, TheWristCameraFindsTheThingWithinTenMillimetres) {
  sim::MujocoWorld world = SimWorld("real");
  for (const KnownTask& known : kKnownTasks) {
    const char* id = known.id;
    const Task task = SimTask(id);
    const int wrist = static_cast<int>(task.cameras.size()) - 1;
    VisualPick policy({.chunk_size = 20});
    for (int state = 0; state < 2; ++state) {
      const WorldStep first = world.Reset(0, task, SimState(state), 1);
      policy.Reset(0, task, 1);
      const SceneObservation asked{0, &first.observation};
      const Acted approach = policy.Act({&asked, 1}).front();
      const SceneChunk chunk{0, &std::get<ActionChunk>(approach)};
      const WorldStep above = std::get<std::vector<WorldStep>>(world.Advance({&chunk, 1}).front()).back();
      const Eigen::Vector2d truth_m = PoseIn(above.privileged, known.thing).translation().head<2>();
      const auto fit = Locate(ViewOf(task, above.observation, wrist), KnowledgeOf(id).thing,
                              {{truth_m + Eigen::Vector2d(0.01, 0.01), 0}, 0.05});
      ASSERT_TRUE(fit) << id << " " << state;
      EXPECT_LT((fit->placement.xy_m - truth_m).norm(), 0.010) << id << " " << state;
    }
  }
}

TEST(VisualPick, MastersItsTasksAndADegradedOneIsWorse) {
  sim::MujocoWorld world = SimWorld("real");
  for (const auto& [id, thing, target] : kKnownTasks) {
    VisualPick clean({}), degraded({.bias_m = {-0.06, 0.05}});
    EXPECT_EQ(Successes(world, clean, SimTask(id), 1, 10), 1) << id;
    EXPECT_EQ(Successes(world, degraded, SimTask(id), 1, 10), 0) << id;
  }
}

/// Answers to two pictures of the beginning, as one text of numbers.
std::vector<double> Answers(std::uint64_t seed, const VisualPickOptions& options) {
  static const Task task = SimTask("take_bottle");
  static const Observation seen = SimWorld("sim").Reset(0, task, SimState(0), 1).observation;
  VisualPick policy(options);
  policy.Reset(3, task, seed);
  std::vector<double> numbers;
  for (int request = 0; request < 5; ++request) {
    Observation here = seen;
    if (!numbers.empty())
      here.arms[0].base_from_gripper.translation() =
          Eigen::Vector3d(numbers.end()[-4], numbers.end()[-3], numbers.end()[-2]);
    const SceneObservation asked{3, &here};
    const ActionChunk chunk = std::get<ActionChunk>(policy.Act({&asked, 1}).front());
    for (const Arms& target : chunk.targets) {
      const Eigen::Vector3d at_m = target[0].base_from_gripper.translation();
      numbers.insert(numbers.end(), {at_m.x(), at_m.y(), at_m.z(), target[0].closure});
    }
  }
  return numbers;
}

TEST(VisualPick, TheSameSeedAndPicturesGetTheSameAnswersAndAnotherSeedOthers) {
  const VisualPickOptions noisy{.noise_m = 0.02, .request_noise_m = 0.01, .blindness = 0.3, .request_blindness = 0.3};
  EXPECT_EQ(Answers(1, noisy), Answers(1, noisy));
  EXPECT_NE(Answers(1, noisy), Answers(2, noisy));
  EXPECT_EQ(Answers(1, {}), Answers(2, {})) << "without noise the seed means nothing";
}

TEST(VisualPick, BlindItGoesWhereTheThingUsuallyIs) {
  const PickKnowledge knowledge = KnowledgeOf("take_bottle");
  const std::vector<double> blind = Answers(1, {.blindness = 1}), seeing = Answers(1, {});
  const auto reached = [&](const std::vector<double>& answers) {  // above the thing: the end of the second chunk
    return Eigen::Vector2d(answers.at(15 * 4), answers.at(15 * 4 + 1));
  };
  EXPECT_LT((reached(blind) - knowledge.usual.placement.xy_m).norm(), 1e-9);
  EXPECT_GT((reached(seeing) - knowledge.usual.placement.xy_m).norm(), 0.005);
}

/// Of a whole episode: every chunk passes the harness's check and moves no faster than the arm can follow.
void ExpectFollowable(const VisualPickOptions& options) {
  const Task task = SimTask("take_toast");
  sim::MujocoWorld world = SimWorld("sim");
  VisualPick policy(options);
  Observation seen = world.Reset(0, task, SimState(4), 1).observation;
  policy.Reset(0, task, 1);
  Arms last = seen.arms;
  for (int told = 0; told < 90; told += options.chunk_size) {
    const SceneObservation asked{0, &seen};
    const ActionChunk chunk = std::get<ActionChunk>(policy.Act({&asked, 1}).front());
    ASSERT_EQ(static_cast<int>(chunk.targets.size()), options.chunk_size);
    EXPECT_EQ(WhatIsWrong(chunk, task, options.chunk_size), std::nullopt);
    for (const Arms& target : chunk.targets) {
      EXPECT_LE((target[0].base_from_gripper.translation() - last[0].base_from_gripper.translation()).norm(), 0.04);
      EXPECT_LE(RotationBetween(target[0].base_from_gripper, last[0].base_from_gripper), 0.3);
      last = target;
    }
    const SceneChunk executed{0, &chunk};
    seen = std::get<std::vector<WorldStep>>(world.Advance({&executed, 1}).front()).back().observation;
  }
}

TEST(VisualPick, ItsChunksAreValidAndSlowEnoughToFollow) { ExpectFollowable({.chunk_size = 5}); }

TEST(VisualPick, HoweverWrongItIsItAsksForNothingOutsideTheWorkspace) {
  ExpectFollowable({.chunk_size = 9, .bias_m = {-0.5, -0.5}});
  ExpectFollowable({.chunk_size = 9, .bias_m = {0.5, 0.5}});
}

/// What it tells the hand, seeing a scene that stands still.
std::vector<ArmState> Told(const VisualPickOptions& options) {
  sim::MujocoWorld world = SimWorld("sim");
  const Task task = SimTask("take_bottle");
  VisualPick policy(options);
  policy.Reset(0, task, 5);
  Observation seen = world.Reset(0, task, SimState(0), 1).observation;
  std::vector<ArmState> told;
  for (int chunk = 0; chunk < 12; ++chunk) {
    const SceneObservation asked{0, &seen};
    const ActionChunk answer = std::get<ActionChunk>(policy.Act({&asked, 1}).front());
    for (const Arms& arms : answer.targets) told.push_back(arms[0]);
    seen.arms = answer.targets.back();
  }
  return told;
}

double Height_m(const ArmState& arm) { return arm.base_from_gripper.translation().z(); }
std::ptrdiff_t FirstClosing(const std::vector<ArmState>& told) {
  return std::find_if(told.begin(), told.end(), [](const ArmState& arm) { return arm.closure > 0; }) - told.begin();
}

TEST(VisualPick, TakesHoldHigherTurnedInAHurryOrOnItsWayDown) {
  const std::vector<ArmState> usual = Told({}), high = Told({.high_m = 0.02}), turned = Told({.turn_deg = 30}),
                              hurried = Told({.hurry = 1}), early = Told({.late_close_s = -0.3});
  const std::ptrdiff_t closing = FirstClosing(usual);
  ASSERT_LT(closing, std::ssize(usual));
  EXPECT_NEAR(Height_m(high[FirstClosing(high)]) - Height_m(usual[closing]), 0.02, 1e-6);
  EXPECT_NEAR(RotationBetween(turned[FirstClosing(turned)].base_from_gripper, usual[closing].base_from_gripper),
              30 * std::numbers::pi / 180, 1e-6);
  EXPECT_GT(Height_m(early[FirstClosing(early)]), Height_m(usual[closing]) + 0.005) << "it is still on its way down";
  const auto lifted = [&](const std::vector<ArmState>& told) {
    std::ptrdiff_t k = FirstClosing(told);
    while (k < std::ssize(told) && Height_m(told[k]) < Height_m(usual[closing]) + 0.02) ++k;
    return k;
  };
  EXPECT_LE(lifted(hurried), lifted(usual) - 5) << "neither waits .1 s nor .55 s";
}

void ExpectRefused(const VisualPickOptions& options, const std::string& name) {
  try {
    VisualPick policy(options);
    ADD_FAILURE() << name << " was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
  }
}

TEST(VisualPick, OptionsOutsideTheirRangeAreRefusedByName) {
  ExpectRefused({.chunk_size = 0}, "chunk-size");
  ExpectRefused({.bias_m = {0, 0.7}}, "bias-m");
  ExpectRefused({.noise_m = -0.01}, "noise-m");
  ExpectRefused({.request_noise_m = std::numeric_limits<double>::quiet_NaN()}, "request-noise-m");
  ExpectRefused({.high_m = 0.1}, "high-m");
  ExpectRefused({.turn_deg = 120}, "turn-deg");
  ExpectRefused({.hurry = 2}, "hurry");
  ExpectRefused({.late_close_s = 9}, "late-close-s");
  ExpectRefused({.late_close_s = -1}, "late-close-s");
  ExpectRefused({.early_release_s = -1}, "early-release-s");
  ExpectRefused({.blindness = 1.1}, "blindness");
  ExpectRefused({.request_blindness = -0.1}, "request-blindness");
  ExpectRefused({.speed = 0}, "speed");
  ExpectRefused({.retries = -1}, "retries");
}

TEST(VisualPick, ATaskItDoesNotKnowOrCannotSeeIsRefused) {
  VisualPick policy({});
  Task unknown = SimTask("take_bottle");
  unknown.id = "fold_shirt";
  EXPECT_THROW(policy.Reset(0, unknown, 1), Error);
  Task sightless = SimTask("take_bottle");
  sightless.cameras.erase(sightless.cameras.begin());
  EXPECT_THROW(policy.Reset(0, sightless, 1), Error);
}

}  // namespace
}  // namespace evac
