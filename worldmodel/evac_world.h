#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/world.h"
#include "worldmodel/imaginer.h"

namespace evac {

/// The first frame of an initial state in the real world, or of its recording. @throws Error if nobody has seen it.
using FirstScene = std::function<InitialScene(const Task& task, const InitialState& initial)>;

/// @param who  for the message: "world evac".
/// @throws InvalidInput unless the task has a camera for each view that the network imagines.
void CheckViews(const Task& task, int views, const std::string& who);

struct EvacWorldOptions {
  std::string name = "evac";
  double period_s = 0.1;  ///< between two of its frames, and of every task
  int threads = 2;        ///< in all
  /// false: one thread per scene, as many scenes at once as there are threads. What a scene answers has the same bits
  /// whatever their number, and small networks gain nothing from a second thread. true: all threads work on one scene,
  /// one after the other; the same bits for one number of threads, ±1 grey level across numbers.
  bool all_threads_per_scene = false;
};

/// The paper's world: a network imagines what the cameras would see (EVAC, Sec. 3). Read Advance first.
///
/// Every episode starts from the first frame of the real run, or of a recording. Nobody measures the imagined arms:
/// observed arms are the last commanded ones and say so. There is no physics, so no privileged track.
/// A chunk may have any length: it is imagined in pieces of the network's K frames; a shorter last piece is filled up
/// as if the arms rested at its end, and what is imagined beyond the last target is neither decoded nor remembered.
/// What a scene answers is a function of the network, the first frame, Reset's seed and the chunks, whatever shares the
/// run. Latents that are no numbers fail their own scene with `diverged`, all else with `world_error`.
class EvacWorld : public World {
 public:
  /// @throws InvalidInput for a number of threads that is none.
  EvacWorld(Imaginer imaginer, FirstScene first_scene, EvacWorldOptions options);

  std::string Name() const override { return options_.name; }
  /// @throws InvalidInput if there is no first scene, it is not the task's, or the task's period is not the world's.
  WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) override;
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override;

 private:
  struct Place {
    ImaginedScene scene;
    std::vector<Camera> cameras;  ///< the task's: of the size that is answered
  };
  /// `imagine` for each scene of the batch, in threads; what it throws fails its scene.
  std::vector<Advanced> ForEach(std::span<const SceneChunk> batch,
                                const std::function<Advanced(Place&, const ActionChunk&)>& imagine);
  int ThreadsPerScene() const { return options_.all_threads_per_scene ? options_.threads : 1; }

  Imaginer imaginer_;
  FirstScene first_scene_;
  EvacWorldOptions options_;
  std::map<SceneId, Place> places_;
};

}  // namespace evac
