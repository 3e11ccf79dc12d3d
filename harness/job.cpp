#include "harness/job.h"

#include "core/seed.h"

namespace evac {

std::uint64_t Job::WorldSeed() const {
  const std::uint64_t seed = SeedFor(SeedFor(SeedFor(key.pair.seed, "world"), key.pair.task), key.pair.initial_state);
  return noise.empty() ? seed : SeedFor(seed, noise);
}

std::uint64_t Job::PolicySeed() const {
  const std::uint64_t seed = SeedFor(SeedFor(SeedFor(key.pair.seed, "policy"), key.pair.task), key.pair.initial_state);
  return SeedFor(SeedFor(seed, key.pair.policy), key.pair.checkpoint);
}

std::optional<Job> JobQueue::Next() {
  if (jobs_.empty()) return std::nullopt;
  Job job = std::move(jobs_.front());
  jobs_.pop_front();
  return job;
}

}  // namespace evac
