#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/world.h"
#include "worldmodel/sim/mujoco_handles.h"
#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/scene.h"
#include "worldmodel/sim/scene_page.h"
#include "worldmodel/sim/workers.h"

namespace evac::sim {

struct MujocoWorldOptions {
  std::string name;               ///< what results are filed under: real, sim
  std::filesystem::path profile;  ///< a page such as profiles/real.yaml
  int threads = 2;                ///< scenes that advance at the same time; no part of any result
  bool film = true;               ///< false: of each chunk only the last step has images, all that a policy is shown
};

/// The stand-in for the real robot: rigid bodies, contact and friction in MuJoCo (Todorov et al. 2012), rendered
/// cameras, one arm or two. Tasks are pages with a `mujoco:` section (docs/add_a_task.md), numbers and axes in
/// docs/mujoco_world.md.
///
/// Pose, colour, light and clutter come from InitialState::seed alone; what a scene answers is a function of the
/// profile, the task, the initial state, Reset's `seed` (sensor noise) and the chunks, bit for bit on one machine.
/// Observed arms are measured; images are as Task::cameras says, taken by cameras that stand where the profile's
/// calibration error puts them. A scene whose physics diverges answers Failure{kDiverged}, one that cannot be drawn
/// Failure{kWorldError}.
class MujocoWorld : public World {
 public:
  /// @throws Error if the profile is wrong or there is no OpenGL.
  explicit MujocoWorld(MujocoWorldOptions options);
  ~MujocoWorld() override;

  std::string Name() const override { return options_.name; }
  /// @throws InvalidInput if the task has no `mujoco:` section, other arms than its scene, or a camera MuJoCo cannot
  /// draw; Error called `diverged` if the physics does while the state settles.
  WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) override;
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override;

  /// Reads the task's page and its scene now, and not where its first episode begins: hours later they may be others.
  /// @throws InvalidInput as Reset, for what can be known without a state.
  void Read(const Task& task) { StageFor(task); }

  const Profile& profile() const { return profile_; }  ///< its hash is stored with the run

 private:
  /// A task's page, read once, and its scene, compiled once.
  struct Stage;
  const Stage& StageFor(const Task& task);
  Scene& SceneAt(SceneId scene);

  MujocoWorldOptions options_;
  Profile profile_;
  std::map<std::string, std::unique_ptr<Stage>> stages_;  ///< by the task page's path and text
  std::map<SceneId, std::unique_ptr<Scene>> scenes_;
  std::unique_ptr<Workers> workers_;  ///< last: their renderers know the models above
};

}  // namespace evac::sim
