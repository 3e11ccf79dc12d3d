#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/types.h"

namespace evac {

/// A running episode's place in a world and in a policy: the lane's number, 0 … lanes - 1. Reset begins a new episode.
using SceneId = int;

/// One period of a world: what may be seen, and what only the oracle may.
struct WorldStep {
  Observation observation;     ///< without images within a chunk if the world is not filmed
  PrivilegedFrame privileged;  ///< empty in worlds that have no physics
};

struct SceneChunk {
  SceneId scene = 0;
  const ActionChunk* chunk = nullptr;  ///< checked (core/check.h), never null
};

/// One step per target of the chunk, in time order; or why the scene could not go on.
using Advanced = std::variant<std::vector<WorldStep>, Failure>;

/// Answers chunks of actions with observations: MuJoCo, a recording, the EVAC network.
///
/// What a scene answers depends on its own Reset and chunks alone, bit for bit: never on the other scenes of the call,
/// their number or order. Not thread-safe; an implementation may use threads inside.
class World {
 public:
  virtual ~World() = default;

  virtual std::string Name() const = 0;

  /// Puts `scene` into the initial state. The same (task, initial, seed) gives the same bytes.
  /// @param seed  the world's own randomness (sensor noise, hidden truth), apart from the initial state's.
  /// @throws Error if this episode cannot start here; called `diverged` if its physics did before the first frame.
  virtual WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) = 0;

  /// Executes one chunk per named scene. Each scene is named at most once and was Reset before.
  /// @returns one answer per element of `batch`, in its order. A scene that fails does not stop the others.
  virtual std::vector<Advanced> Advance(std::span<const SceneChunk> batch) = 0;
};

}  // namespace evac
