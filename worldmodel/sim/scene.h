#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/world.h"
#include "worldmodel/sim/arm_control.h"
#include "worldmodel/sim/mujoco_handles.h"
#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/renderer.h"
#include "worldmodel/sim/scene_page.h"
#include "worldmodel/sim/sensors.h"

namespace evac::sim {

/// One episode in MuJoCo: its own model (colours, friction, … are its own), its state, its controller and its streams
/// of noise.
class Scene {
 public:
  struct Setup {
    const mjModel* base = nullptr;  ///< the compiled scene; outlives this
    const ScenePage* page = nullptr;
    const Profile* profile = nullptr;
    Task task;
    InitialState initial;
    std::uint64_t seed = 0;  ///< of the sensors' noise
  };

  /// Stands at rest in the initial state. @throws InvalidInput if task and scene do not fit together.
  explicit Scene(Setup setup);

  /// One period towards the target.
  void Drive(const Arms& target);

  /// What sensors and oracle see now; without a renderer, no images. The n-th call has the n-th frame's noise, whatever
  /// was drawn before.
  WorldStep Observe(Renderer* renderer);

  /// Why the physics can no longer be trusted, with the simulated time, or nothing.
  std::optional<std::string> WhyDiverged() const;

 private:
  void StartArms();
  void StepPhysics();
  Arms TrueArms() const;
  /// What each camera of the task sees, with the sensors' noise.
  std::vector<cv::Mat> Pictures(Renderer& renderer, const Arms& arms, std::uint64_t frame_seed);

  Setup setup_;
  HiddenErrors errors_;
  ModelPtr model_;
  DataPtr data_;
  std::vector<ArmControl> controls_;  ///< per arm of the task
  int steps_per_period_ = 0;
  std::uint64_t noise_seed_ = 0;
  std::uint64_t frame_ = 0;
};

}  // namespace evac::sim
