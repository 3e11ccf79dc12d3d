#include "policies/explorer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "policies/gripper_poses.h"

namespace evac {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLowest_m = 0.026;  // fingertips just above a board that lies on the table
constexpr double kHover_m = 0.24;    // above everything that stands there
constexpr double kClosing_s = 0.55;
constexpr double kSamples = 40;  // of places until one is far enough from the thing

/// Where the working arm may be sent without reaching across the workspace's edge.
struct Region {
  Eigen::Vector2d low_m{0.26, -0.26}, high_m{0.54, 0.26};
};

/// What one plan is made from.
struct Surroundings {
  const PickKnowledge& knowledge;
  Placement thing, target;  ///< as seen, else as usual
  SplitMix64& random;
};

class Sketch {
 public:
  Sketch(const Eigen::Isometry3d& start, const SpeedLimits& limits) : path_(start, limits) {}

  void MoveTo(const Eigen::Vector2d& xy_m, double z_m, double yaw_rad) {
    path_.MoveTo(PointingDown(xy_m, z_m, yaw_rad));
  }
  void Pause(double duration_s) { path_.Pause(duration_s); }
  double now_s() const { return path_.duration_s(); }
  Timeline& path() { return path_; }

 private:
  Timeline path_;
};

Eigen::Vector2d Direction(double angle_rad) { return {std::cos(angle_rad), std::sin(angle_rad)}; }

Eigen::Vector2d Somewhere(SplitMix64& random) {
  const Region region;
  const double x_m = random.Uniform(region.low_m.x(), region.high_m.x());
  return {x_m, random.Uniform(region.low_m.y(), region.high_m.y())};
}

/// The part of the options' speed that a plan goes at is its own; what follows says where to.
struct Plotted {
  Sketch sketch;
  std::vector<std::pair<double, double>> hand;  ///< (begin_s, closure)
};

void PlotPush(const Surroundings& around, Plotted& plot) {
  SplitMix64& random = around.random;
  const Eigen::Vector2d forward = Direction(random.Uniform(0, 2 * kPi));
  const Eigen::Vector2d aside = 0.012 * random.Normal() * Eigen::Vector2d(-forward.y(), forward.x());
  const double begin_m = random.Uniform(0.08, 0.13), end_m = random.Uniform(0.04, 0.15);
  const double height_m = std::max(kLowest_m, around.knowledge.grasp_m * random.Uniform(0.55, 1.0));
  const double yaw_rad = random.Uniform(-kPi / 2, kPi / 2);
  const bool closed = random.Uniform() < 0.7;
  const Eigen::Vector2d from_m = around.thing.xy_m + aside - begin_m * forward,
                        to_m = around.thing.xy_m + aside + end_m * forward;
  if (closed) plot.hand.emplace_back(0.2, 1);
  plot.sketch.MoveTo(from_m, kHover_m, yaw_rad);
  plot.sketch.MoveTo(from_m, height_m, yaw_rad);
  plot.sketch.MoveTo(to_m, height_m, yaw_rad);
  if (closed && random.Uniform() < 0.5) plot.hand.emplace_back(plot.sketch.now_s(), 0);
  plot.sketch.MoveTo(to_m, kHover_m, yaw_rad);
}

/// The gripper straddles a rim `radius_m` from the middle, opening along the radius.
void PlotWrongObject(const Surroundings& around, Plotted& plot) {
  SplitMix64& random = around.random;
  const bool has_target = around.knowledge.target.has_value();
  const Placement& wrong = has_target ? around.target : around.thing;
  const double quarter_rad = kPi / 2 * static_cast<double>(random.Below(4));
  const double angle_rad = wrong.yaw_rad + quarter_rad + (has_target ? 0.05 * random.Normal() : 0);
  const double radius_m = (has_target ? around.knowledge.target_rim_m : 0.038) + 0.004 * random.Normal();
  const double height_m = has_target ? around.knowledge.target_floor_m + 0.017 : 0.07;
  const Eigen::Vector2d at_m = wrong.xy_m + radius_m * Direction(angle_rad);
  const Eigen::Vector2d to_m = Somewhere(random);
  const double yaw_rad = angle_rad + kPi / 2;  // the fingers open along y
  plot.sketch.MoveTo(at_m, kHover_m, yaw_rad);
  plot.sketch.MoveTo(at_m, height_m, yaw_rad);
  plot.hand.emplace_back(plot.sketch.now_s(), 1);
  plot.sketch.Pause(kClosing_s);
  plot.sketch.MoveTo(at_m, height_m + random.Uniform(0.03, 0.09), yaw_rad);
  if (random.Uniform() < 0.5) plot.sketch.MoveTo(to_m, height_m + 0.09, yaw_rad);
  plot.hand.emplace_back(plot.sketch.now_s() + 0.2, 0);
  plot.sketch.Pause(0.5);
}

/// @param lowest_m  of the gripper
void PlotWaypoints(const Surroundings& around, double lowest_m, double highest_m, Plotted& plot) {
  SplitMix64& random = around.random;
  const int waypoints = 4 + static_cast<int>(random.Below(4));
  double closure = 0;
  for (int i = 0; i < waypoints; ++i) {
    const Eigen::Vector2d xy_m = Somewhere(random);
    const double z_m = random.Uniform(lowest_m, highest_m), yaw_rad = random.Uniform(-kPi / 2, kPi / 2);
    plot.sketch.MoveTo(xy_m, z_m, yaw_rad);
    if (random.Uniform() < 0.5)
      plot.hand.emplace_back(plot.sketch.now_s() - random.Uniform(0, 0.5), closure = 1 - closure);
    if (random.Uniform() < 0.3) plot.sketch.Pause(random.Uniform(0.1, 0.6));
  }
}

void Require(const char* option, double found, double low, double high) {
  if (std::isfinite(found) && found >= low && found <= high) return;
  throw InvalidInput("explorer: {} is {}, wanted a number from {} to {}", option, found, low, high);
}

/// Where the head camera sees them, else where they usually are.
void LookOnce(const Task& task, const Observation& observation, Surroundings& around) {
  const std::optional<View> head = ViewOf("head", task, observation);
  if (!head) return;
  const PickKnowledge& knowledge = around.knowledge;
  if (const auto fit = Locate(*head, knowledge.thing, knowledge.usual)) around.thing = fit->placement;
  if (!knowledge.target) return;
  if (const auto fit = Locate(*head, *knowledge.target, knowledge.usual_target)) around.target = fit->placement;
}

}  // namespace

Exploration ExplorationFromName(const std::string& name) {
  if (name == "push") return Exploration::kPush;
  if (name == "wrong_object") return Exploration::kWrongObject;
  if (name == "roam") return Exploration::kRoam;
  if (name == "random") return Exploration::kRandom;
  throw InvalidInput("explorer: found does '{}', wanted push, wrong_object, roam or random", name);
}

Explorer::Explorer(const ExplorerOptions& options) : options_(options) {
  Require("chunk-size", options.chunk_size, 1, 1000);
  Require("speed", options.speed, 0.1, 1.5);
}

void Explorer::Reset(SceneId scene, const Task& task, std::uint64_t seed) {
  KnowledgeOf(task.id);
  episodes_.insert_or_assign(scene, Episode{task, seed, std::nullopt, std::nullopt, 0, 0});
}

Explorer::Plan Explorer::MakePlan(const Episode& episode, const Observation& observation) const {
  SplitMix64 random(SeedFor(episode.seed, "explorer"));
  const PickKnowledge knowledge = KnowledgeOf(episode.task.id);
  Surroundings around{knowledge, knowledge.usual.placement, knowledge.usual_target.placement, random};
  LookOnce(episode.task, observation, around);
  SpeedLimits limits;
  limits.translation_mps *= options_.speed;
  limits.rotation_radps *= options_.speed;
  const Eigen::Isometry3d home = observation.arms.back().base_from_gripper;
  Plotted plot{Sketch(home, limits), {}};
  switch (options_.does) {
    case Exploration::kPush:
      PlotPush(around, plot);
      break;
    case Exploration::kWrongObject:
      PlotWrongObject(around, plot);
      break;
    case Exploration::kRoam:
      PlotWaypoints(around, 0.20, 0.34, plot);
      break;
    case Exploration::kRandom:
      PlotWaypoints(around, kLowest_m, 0.22, plot);
      break;
  }
  if (random.Uniform() < 0.5) plot.sketch.path().MoveTo(home);
  Plan plan{plot.sketch.path(), {}};
  for (const auto& [begin_s, closure] : plot.hand) plan.hand.push_back({begin_s, closure});
  return plan;
}

ArmState Explorer::Next(Episode& episode) const {
  ++episode.told;
  const double now_s = episode.told * episode.task.period_s, step = episode.task.period_s / HandSchedule::kTravel_s;
  double goal = 0;
  for (const HandTurn& turn : episode.plan->hand) goal = now_s > turn.begin_s ? turn.closure : goal;
  episode.closure += std::clamp(goal - episode.closure, -step, step);
  return {Inside(episode.plan->path.At(now_s), episode.task.workspace_m), std::clamp(episode.closure, 0.0, 1.0)};
}

std::vector<Acted> Explorer::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers;
  for (const auto& [scene, observation] : batch) {
    const auto found = episodes_.find(scene);
    if (found == episodes_.end()) throw InternalError("explorer was asked for scene {} before its Reset", scene);
    Episode& episode = found->second;
    if (!episode.plan) {
      episode.plan = MakePlan(episode, *observation);
      if (observation->arms.size() == 2) episode.left = Held(observation->arms.front());
    }
    ActionChunk chunk;
    for (int k = 0; k < options_.chunk_size; ++k) {
      const ArmState right = Next(episode);
      chunk.targets.push_back(episode.left ? Arms{*episode.left, right} : Arms{right});
    }
    answers.push_back(std::move(chunk));
  }
  return answers;
}

}  // namespace evac
