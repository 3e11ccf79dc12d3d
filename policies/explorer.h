#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/policy.h"
#include "policies/visual_motion.h"
#include "policies/visual_things.h"

namespace evac {

/// What an explorer does instead of the task.
enum class Exploration {
  kPush,         ///< goes down beside the thing and sweeps through it
  kWrongObject,  ///< takes hold of the rim of what the thing belongs on or stands in, and lifts
  kRoam,         ///< moves freely through the air, its hand opening and closing
  kRandom,       ///< the same down to the table and faster, whatever stands there
};
/// "push", "wrong_object", "roam", "random". @throws InvalidInput for another name.
Exploration ExplorationFromName(const std::string& name);

struct ExplorerOptions {
  Exploration does = Exploration::kRoam;
  int chunk_size = 8;  ///< targets per chunk, [1, 1000]
  double speed = 1;    ///< of all motion, [0.1, 1.5]; at 1 no faster than SpeedLimits' defaults
};

/// Shows a world what other policies never do. It looks once, with the head camera, for the things that visual_pick
/// knows, makes one plan, follows it and rests; where it goes is random. Its plan is a function of the first picture
/// and Reset's seed.
class Explorer : public Policy {
 public:
  /// @throws InvalidInput naming an option out of its range.
  explicit Explorer(const ExplorerOptions& options);

  std::string Name() const override { return "explorer"; }
  /// The right arm moves; a left one stays where it is and goes on holding what it holds.
  /// @throws InvalidInput for a task that visual_pick does not know either.
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  /// From `begin_s` on the hand goes to `closure`, from open to closed in HandSchedule::kTravel_s.
  struct HandTurn {
    double begin_s = 0, closure = 0;
  };
  struct Plan {
    Timeline path;
    std::vector<HandTurn> hand;  ///< in time order
  };
  struct Episode {
    Task task;
    std::uint64_t seed = 0;
    std::optional<Plan> plan;  ///< none before the first look
    std::optional<ArmState> left;
    double closure = 0;  ///< last told
    int told = 0;        ///< targets given
  };

  Plan MakePlan(const Episode& episode, const Observation& observation) const;
  ArmState Next(Episode& episode) const;

  ExplorerOptions options_;
  std::map<SceneId, Episode> episodes_;
};

}  // namespace evac
