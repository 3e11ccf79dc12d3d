#include "harness/start_probe.h"

#include <fmt/format.h>

#include <cmath>
#include <exception>

#include "core/geometry.h"

namespace evac {
namespace {

using Eigen::Isometry3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

double Distance_m(const ArmState& a, const ArmState& b) {
  return (a.base_from_gripper.translation() - b.base_from_gripper.translation()).norm();
}

/// What was meant by a quaternion w x y z that was read as x y z w.
Quaterniond ReadAsWxyz(const Isometry3d& pose) {
  const Quaterniond sent(pose.linear());
  return Quaterniond(sent.x(), sent.y(), sent.z(), sent.w());
}

std::string WhyFar(const ArmState& at, const ArmState& to, const Arms& observed) {
  const Vector3d from_m = at.base_from_gripper.translation(), to_m = to.base_from_gripper.translation();
  if ((to_m / 1000 - from_m).norm() < kLongestFirstStep_m) return "; it would fit if it were in millimetres";
  if (to_m.norm() < kLongestFirstStep_m / 2) return "; it would fit if it were a delta to that, not an absolute target";
  for (const ArmState& other : observed) {
    if (&other != &at && Distance_m(other, to) < kLongestFirstStep_m)
      return "; it would fit the other arm: are the arms swapped?";
  }
  return "; is it in another frame?";
}

std::string WhyTurned(const ArmState& at, const ArmState& to) {
  const Quaterniond meant = ReadAsWxyz(to.base_from_gripper), is(at.base_from_gripper.linear());
  if (meant.angularDistance(is) < kLargestFirstTurn_rad / 2) return "; it would fit if its quaternion were w x y z";
  if (Quaterniond(to.base_from_gripper.linear()).angularDistance(Quaterniond::Identity()) < kLargestFirstTurn_rad / 4)
    return "; it would fit if it were a delta to that, not an absolute target";
  return "; are its angles in degrees, or in another frame?";
}

/// The fastest way from one target to the next.
double Fastest_m_s(const ActionChunk& chunk, std::size_t arm, double period_s) {
  double fastest_m_s = 0;
  for (std::size_t k = 1; k < chunk.targets.size(); ++k)
    fastest_m_s = std::max(fastest_m_s, Distance_m(chunk.targets[k][arm], chunk.targets[k - 1][arm]) / period_s);
  return fastest_m_s;
}

void Look(const Arms& observed, std::size_t arm, const ActionChunk& chunk, const Task& task,
          std::vector<Suspicion>& found) {
  const ArmState &at = observed[arm], &to = chunk.targets.front()[arm];
  const auto suspect = [&](bool is_certain, const std::string& sentence) {
    found.push_back({task.arms[arm] + " arm: " + sentence, is_certain});
  };
  const double step_m = Distance_m(at, to), turn_rad = RotationBetween(at.base_from_gripper, to.base_from_gripper);
  if (step_m > kLongestFirstStep_m)
    suspect(true,
            fmt::format("the first target is {:.3g} m from where the arm is{}", step_m, WhyFar(at, to, observed)));
  if (turn_rad > kLargestFirstTurn_rad)
    suspect(true, fmt::format("the first target is turned by {:.2f} rad from how the hand is{}", turn_rad,
                              WhyTurned(at, to)));
  if (to.closure < 0 || to.closure > 1) {
    suspect(true, fmt::format(
                      "the first closure is {:.4g}, wanted 0 (open) … 1 (closed): is it in degrees or a vendor's unit?",
                      to.closure));
  } else if (std::abs(to.closure - at.closure) > kSuddenClosure) {
    suspect(false, fmt::format("the hand's closure is {:.2f} and its first target {:.2f}: is it reversed?", at.closure,
                               to.closure));
  }
  const double fastest_m_s = Fastest_m_s(chunk, arm, task.period_s);
  if (fastest_m_s > kFastestTarget_m_s) {
    suspect(true, fmt::format("its targets are up to {:.3g} m apart, which is {:.3g} m/s at a period of {} s: are they "
                              "for another period?",
                              fastest_m_s * task.period_s, fastest_m_s, task.period_s));
  }
}

}  // namespace

std::vector<Suspicion> StartSuspicions(const Arms& observed, const ActionChunk& chunk, const Task& task) {
  std::vector<Suspicion> found;
  for (const Arms& target : chunk.targets) {
    if (target.size() != observed.size()) return found;  // a malformed chunk: its episode says so
  }
  for (std::size_t arm = 0; !chunk.targets.empty() && arm < observed.size(); ++arm)
    Look(observed, arm, chunk, task, found);
  return found;
}

std::vector<Suspicion> ProbeStart(Policy& policy, World& world, const Job& job) try {
  const WorldStep first = world.Reset(0, *job.task, job.initial, job.WorldSeed());
  policy.Reset(0, *job.task, job.PolicySeed());
  const SceneObservation asked{0, &first.observation};
  const std::vector<Acted> answers = policy.Act({&asked, 1});
  const auto* chunk = answers.empty() ? nullptr : std::get_if<ActionChunk>(&answers.front());
  return chunk ? StartSuspicions(first.observation.arms, *chunk, *job.task) : std::vector<Suspicion>();
} catch (const std::exception&) {
  return {};
}

}  // namespace evac
