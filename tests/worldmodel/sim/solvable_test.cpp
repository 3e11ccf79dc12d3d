#include <gtest/gtest.h>

#include "core/seed.h"
#include "tests/worldmodel/sim/scripted_pick.h"
#include "tests/worldmodel/sim/sim_test_support.h"

namespace evac::test {
namespace {

/// Without cameras nothing is drawn: these tests ask physics alone.
Task Unseen(Task task) {
  task.cameras.clear();
  return task;
}

double HeightOf(const WorldStep& step, const std::string& body) {
  return PoseIn(step.privileged, body).translation().z();
}

double HorizontalDistance(const WorldStep& step, const std::string& a, const std::string& b) {
  return (PoseIn(step.privileged, a).translation() - PoseIn(step.privileged, b).translation()).head<2>().norm();
}

double UprightCosine(const WorldStep& step, const std::string& body) {
  return PoseIn(step.privileged, body).linear()(2, 2);
}

double HighestOf(const std::vector<WorldStep>& steps, const std::string& body) {
  double highest_m = -1;
  for (const WorldStep& step : steps) highest_m = std::max(highest_m, HeightOf(step, body));
  return highest_m;
}

bool BottleStandsOutside(const std::vector<WorldStep>& steps) {
  const WorldStep& last = steps.back();
  return HighestOf(steps, "bottle") > 0.1 && HeightOf(last, "bottle") < 0.01 && UprightCosine(last, "bottle") > 0.99 &&
         HorizontalDistance(last, "bottle", "box") > 0.08 && ForceIn(last.privileged, "bottle", "table") > 1;
}

bool ToastLiesOnPlate(const std::vector<WorldStep>& steps) {
  const WorldStep& last = steps.back();
  return HighestOf(steps, "toast") > 0.1 && HeightOf(last, "toast") < 0.03 &&
         std::abs(UprightCosine(last, "toast")) < 0.1 && HorizontalDistance(last, "toast", "plate") < 0.06 &&
         ForceIn(last.privileged, "plate", "toast") > 0.2;
}

bool HamLiesOnBread(const std::vector<WorldStep>& steps) {
  const WorldStep& last = steps.back();
  return HighestOf(steps, "ham") > 0.1 && HeightOf(last, "ham") < 0.03 &&
         HorizontalDistance(last, "ham", "bread") < 0.03 && ForceIn(last.privileged, "bread", "ham") > 0.2;
}

bool LeafLiesInBowl(const std::vector<WorldStep>& steps) {
  const WorldStep& last = steps.back();
  return HighestOf(steps, "leaf") > 0.1 && HeightOf(last, "leaf") < 0.05 &&
         HorizontalDistance(last, "leaf", "bowl") < 0.06 && ForceIn(last.privileged, "bowl", "leaf") > 0.2 &&
         ForceIn(last.privileged, "leaf", "table") == 0;
}

PickAndPlace PerfectPlan(const std::string& task, const PrivilegedFrame& frame, const ArmState& home) {
  if (task == "take_bottle") return PlanBottle(frame, home);
  if (task == "take_toast") return PlanToast(frame, home);
  if (task == "take_ham") return PlanHam(frame, home);
  return PlanLettuce(frame, home);
}

struct Attempt {
  WorldStep first;
  std::vector<WorldStep> steps;
};

/// `change` spoils the perfect plan.
template <typename Change>
Attempt Try(World& world, const Task& task, std::uint64_t seed, Change change) {
  Attempt attempt{world.Reset(0, task, State(seed), 1), {}};
  const ArmState home = attempt.first.observation.arms[0];
  PickAndPlace plan = PerfectPlan(task.id, attempt.first.privileged, home);
  change(plan);
  attempt.steps = Advance(world, 0, Targets(home, Plan(plan)));
  return attempt;
}

Attempt Try(World& world, const Task& task, std::uint64_t seed) {
  return Try(world, task, seed, [](PickAndPlace&) {});
}

class InBothProfiles : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(MujocoWorld, InBothProfiles, ::testing::Values("real", "sim"),
                         [](const auto& info) { return std::string(info.param); });

TEST_P(InBothProfiles, APerfectMotionTakesTheBottleOutByFrictionAlone) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_bottle"));
  int solved = 0;
  for (std::uint64_t i = 0; i < 10; ++i) solved += BottleStandsOutside(Try(world, task, SeedFor(7, i)).steps);
  EXPECT_GE(solved, 9);
}

TEST_P(InBothProfiles, APerfectMotionPutsTheToastOnThePlateByFrictionAlone) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_toast"));
  int solved = 0;
  for (std::uint64_t i = 0; i < 10; ++i) solved += ToastLiesOnPlate(Try(world, task, SeedFor(7, i)).steps);
  EXPECT_GE(solved, 9);
}

TEST_P(InBothProfiles, APerfectMotionLaysTheHamOnTheBreadByFrictionAlone) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_ham"));
  int solved = 0;
  for (std::uint64_t i = 0; i < 10; ++i) solved += HamLiesOnBread(Try(world, task, SeedFor(7, i)).steps);
  EXPECT_GE(solved, 9);
}

TEST_P(InBothProfiles, APerfectMotionPutsTheLeafIntoTheBowlByFrictionAlone) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_lettuce"));
  int solved = 0;
  for (std::uint64_t i = 0; i < 10; ++i) solved += LeafLiesInBowl(Try(world, task, SeedFor(7, i)).steps);
  EXPECT_GE(solved, 9);
}

/// Degrees between the z axes of a thing's middle and of a part linked to it.
double Bend(const WorldStep& step, const std::string& thing, const std::string& part) {
  const Eigen::Vector3d of_thing = PoseIn(step.privileged, thing).linear().col(2);
  return std::acos(std::clamp(of_thing.dot(PoseIn(step.privileged, part).linear().col(2)), -1.0, 1.0)) * 180 / M_PI;
}

TEST_P(InBothProfiles, HeldHamHangsDownAndLiesFlatAgain) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Attempt attempt = Try(world, Unseen(ReadTask("take_ham")), 5);
  const WorldStep& held = attempt.steps[52];
  ASSERT_GT(HeightOf(held, "ham"), 0.2);
  EXPECT_LT(Bend(attempt.first, "ham", "ham_left_edge"), 15);
  EXPECT_GT(Bend(held, "ham", "ham_left_edge"), 40);
  EXPECT_LT(Bend(attempt.steps.back(), "ham", "ham_left_edge"), 25);
}

TEST_P(InBothProfiles, AnEmptyGraspStaysAMiss) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_bottle"));
  const Attempt attempt = Try(world, task, 3, [](PickAndPlace& plan) { plan.pick_m.x() -= 0.06; });
  EXPECT_LT(HighestOf(attempt.steps, "bottle"), 0.02);
  EXPECT_GT(attempt.steps[50].observation.arms[0].closure, 0.98);  // the fingers met
}

TEST_P(InBothProfiles, FingersThatDoNotCloseLiftNothing) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_bottle"));
  const Attempt attempt = Try(world, task, 4, [](PickAndPlace& plan) { plan.hold_closure = 0.4; });
  EXPECT_LT(HighestOf(attempt.steps, "bottle"), 0.02);
}

TEST_P(InBothProfiles, BoxesThatNobodyTouchesStayWhereTheyAre) {
  sim::MujocoWorld world = MakeWorld(GetParam());
  const Task task = Unseen(ReadTask("take_toast"));
  for (std::uint64_t i = 0; i < 4; ++i) {
    const WorldStep first = world.Reset(0, task, State(i), 1);
    const auto steps = Advance(world, 0, std::vector<Arms>(60, first.observation.arms));
    for (const std::string body : {"holder", "toast", "plate"}) {
      EXPECT_LT(
          (PoseIn(steps.back().privileged, body).translation() - PoseIn(first.privileged, body).translation()).norm(),
          0.002)
          << body << i;
    }
  }
}

}  // namespace
}  // namespace evac::test
