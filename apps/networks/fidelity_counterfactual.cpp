#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "apps/networks/fidelity_plans.h"
#include "core/error.h"
#include "core/seed.h"
#include "worldmodel/sim/scene_page.h"

namespace evac {
namespace {

constexpr double kShift_m = 0.06;   ///< beside the object: no hand here is so wide
constexpr int kShiftSteps = 8;      ///< in which the shift is reached

/// An order that has nothing to do with outcome or policy, the same every time.
void Shuffle(std::vector<Replay>& replays) {
  SplitMix64 random(SeedFor(0, "counterfactual"));
  for (std::size_t i = replays.size(); i > 1; --i) std::swap(replays[i - 1], replays[random.Below(i)]);
}

/// At most `count` per task.
std::vector<Replay> FirstOfEachTask(std::vector<Replay> replays, int count) {
  std::map<std::string, int> taken;
  std::erase_if(replays, [&](const Replay& replay) { return ++taken[replay.pair.task] > count; });
  return replays;
}

/// The right arm beside where it was, in a direction that the pair decides.
void ShiftBeside(Replay& replay) {
  SplitMix64 random(SeedFor(SeedFor(SeedFor(0, "shift"), replay.pair.task), replay.pair.initial_state));
  const double angle = random.Uniform(0, 2 * std::numbers::pi);
  const Eigen::Vector3d shift_m(kShift_m * std::cos(angle), kShift_m * std::sin(angle), 0);
  const Eigen::AlignedBox3d& box_m = replay.task->workspace_m;
  for (std::size_t k = 0; k < replay.actions.size(); ++k) {
    auto at_m = replay.actions[k].back().base_from_gripper.translation();
    const double part = std::min(1.0, static_cast<double>(k + 1) / kShiftSteps);
    at_m = (Eigen::Vector3d(at_m) + part * shift_m).cwiseMax(box_m.min()).cwiseMin(box_m.max());
  }
}

void NeverClose(Replay& replay) {
  for (Arms& arms : replay.actions) arms.back().closure = 0;
}

/// The body that the task is about: what its first stage brings the gripper to.
std::string ObjectOf(const Task& task) {
  for (const Stage& stage : task.rubric.stages) {
    for (const Condition& condition : stage.all_of) {
      if (condition.a == "gripper" && !condition.b.empty()) return condition.b;
    }
  }
  throw InvalidInput("{}: field rubric: no stage brings the gripper to a body, wanted one: it is what the counterfactual "
                     "object_away takes away", task.page_path);
}

}  // namespace

std::vector<Task> ToTheLastAction(std::vector<Task> tasks, const Suite& suite) {
  constexpr double kLongestThought_s = 3600;  // where it is measured no suite says how long
  for (Task& task : tasks) {
    task.still.enabled = false;
    const double per_chunk = suite.chunk_size + suite.latency.Periods(kLongestThought_s, task.period_s);
    task.max_chunks = static_cast<int>(std::min(1e6, task.max_chunks * per_chunk / suite.chunk_size)) + 1;
  }
  return tasks;
}

std::vector<Counterfactual> Counterfactuals(std::vector<Replay> successes, const std::vector<Task>& tasks, int per_task) {
  Shuffle(successes);
  const std::vector<Replay> chosen = FirstOfEachTask(std::move(successes), per_task);
  std::vector<Counterfactual> kinds = {{"shifted", tasks, chosen}, {"never_closes", tasks, chosen}, {"object_away", {}, chosen}};
  for (Replay& replay : kinds[0].replays) ShiftBeside(replay);
  for (Replay& replay : kinds[1].replays) NeverClose(replay);
  for (const Task& task : tasks) kinds[2].tasks.push_back(sim::WithoutObject(task, ObjectOf(task)));
  return kinds;
}

std::vector<Replay> LongRollouts(std::vector<Replay> replays, const LongRollout& how) {
  Shuffle(replays);
  std::vector<Replay> chosen = FirstOfEachTask(std::move(replays), how.per_task);
  std::erase_if(chosen, [](const Replay& replay) { return replay.actions.empty(); });
  for (Replay& replay : chosen) {
    const std::vector<Arms> there = replay.actions, back(there.rbegin(), there.rend());
    for (bool forth = false; replay.actions.size() < how.frames; forth = !forth) {
      const std::vector<Arms>& more = forth ? there : back;
      replay.actions.insert(replay.actions.end(), more.begin(), more.end());
    }
    replay.actions.resize(how.frames);
  }
  return chosen;
}

}  // namespace evac
