#include "harness/scheduler.h"

#include <algorithm>

#include "core/seed.h"

namespace evac {

InitialState StateOn(const Task& task, const InitialState& state) { return {state.id, SeedFor(state.seed, task.id)}; }

std::vector<Job> AllJobs(const Suite& suite, const SuiteWorld& world, const SuitePolicy& policy) {
  std::vector<Job> jobs;
  const bool has_own_noise = world.type == "mujoco" && !world.is_real;
  for (const Task& task : suite.tasks) {
    for (const InitialState& state : StatesOf(suite, world)) {
      for (const std::uint64_t seed : suite.seeds) {
        jobs.push_back({.task = &task,
                        .initial = StateOn(task, state),
                        .key = {{task.id, state.id, policy.name, policy.checkpoint, seed}, world.name},
                        .noise = has_own_noise ? world.name : ""});
      }
    }
  }
  return jobs;
}

std::vector<PlannedEpisodes> PlannedOf(const Suite& suite) {
  std::vector<PlannedEpisodes> plan;
  for (const SuiteWorld& world : suite.worlds) {
    const auto of_each = std::ssize(StatesOf(suite, world)) * std::ssize(suite.seeds);
    for (const SuitePolicy& policy : suite.policies) {
      for (const Task& task : suite.tasks)
        plan.push_back({task.id, world.name, policy.name, policy.checkpoint, of_each});
    }
  }
  return plan;
}

std::vector<Job> MissingJobs(std::vector<Job> jobs, const Store& store) {
  std::erase_if(jobs, [&](const Job& job) { return store.Has(job.key); });
  return jobs;
}

std::vector<SuiteWorld> RealFirst(std::vector<SuiteWorld> worlds) {
  std::stable_partition(worlds.begin(), worlds.end(), [](const SuiteWorld& world) { return world.is_real; });
  return worlds;
}

}  // namespace evac
