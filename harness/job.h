#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// One episode to run.
struct Job {
  const Task* task = nullptr;  ///< outlives the run
  InitialState initial;
  EpisodeKey key;
  std::string noise = {};  ///< whose noise the world has; empty: the real one's, which imagining worlds share

  /// The world's randomness: the same for every policy, so that all of them meet the same world, and for every
  /// checkpoint of a world model. A simulated world beside the real one has noise of its own, even of one profile.
  std::uint64_t WorldSeed() const;
  /// The policy's noise: the same in every world, so that a pair differs by the world alone.
  std::uint64_t PolicySeed() const;
};

/// The episodes still to run, first in, first out.
class JobQueue {
 public:
  explicit JobQueue(std::vector<Job> jobs) : jobs_(jobs.begin(), jobs.end()) {}
  std::optional<Job> Next();
  std::size_t size() const { return jobs_.size(); }

 private:
  std::deque<Job> jobs_;
};

}  // namespace evac
