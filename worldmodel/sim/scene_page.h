#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac::sim {

struct Range {
  double low = 0, high = 0;
};

/// Where a free body begins: uniform in these ranges, in the base frame or in that of the body it is `inside` of.
struct Placement {
  std::string body;
  std::string inside;  ///< an earlier body of the list, or empty
  Range x_m, y_m, yaw_deg;
  double z_m = 0;
};

/// How the colour of some materials varies: the same draw for all of them, in HSV.
struct ColourVariation {
  std::vector<std::string> materials;
  Range hue_deg;            ///< added
  Range saturation, value;  ///< factors
};

struct LightVariation {
  Range strength;     ///< factor
  Range azimuth_deg;  ///< turns the lamps about the vertical
  Range warmth;       ///< red times 1 + warmth, blue times 1 - warmth
};

/// Fixed bodies that stand around: each is there with a chance, at a place of its own.
struct Clutter {
  std::vector<std::string> bodies;
  double chance = 0;
  std::vector<Eigen::Vector2d> places_m;
  double spread_m = 0;  ///< uniform, either way, per axis
};

/// Where one gripper is in the first frame: in the base frame or in that of the free body it is `inside` of.
struct Home {
  std::string inside;  ///< empty: base frame
  Eigen::Isometry3d around_from_gripper = Eigen::Isometry3d::Identity();
  double closure = 0;
};

/// The `mujoco:` section of a task page: what only this world needs to know about a task.
struct ScenePage {
  std::filesystem::path scene;  ///< MJCF
  std::vector<Home> homes;      ///< in the order of Task::arms
  std::vector<Placement> placements;
  std::vector<ColourVariation> colours;
  LightVariation light;
  Clutter clutter;
};

/// @throws InvalidInput if the task's page has no such section or something is wrong in it.
ScenePage ReadScenePage(const Task& task);

/// The same task with one of its things taken away: it lies on the floor behind every camera. All else of an initial
/// state stays as it is; the rubric's bodies are still there.
/// @throws InvalidInput if no object of the page has that name.
Task WithoutObject(const Task& task, const std::string& body);

}  // namespace evac::sim
