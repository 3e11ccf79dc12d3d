#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/types.h"
#include "core/world.h"

namespace evac {

struct SceneObservation {
  SceneId scene = 0;
  const Observation* observation = nullptr;  ///< never null
};

using Acted = std::variant<ActionChunk, Failure>;

/// Answers observations with chunks of actions: a process at the end of an LCM link, a replayed recording.
///
/// Its answer is a function of the scene's Reset arguments and observations so far; its own noise comes from `seed`, so that
/// the same request asked again gets the same answer.
class Policy {
 public:
  virtual ~Policy() = default;

  virtual std::string Name() const = 0;

  /// Begins an episode in `scene`.
  /// @param seed  the same in every world for one pair key: paired comparisons share the policy's noise.
  /// @throws Error if the policy refuses the task.
  virtual void Reset(SceneId scene, const Task& task, std::uint64_t seed) = 0;

  /// One chunk per scene asked, in the order of `batch`, or why there is none (policy_error, policy_timeout).
  virtual std::vector<Acted> Act(std::span<const SceneObservation> batch) = 0;
};

}  // namespace evac
