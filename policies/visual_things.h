#pragma once

#include <optional>
#include <string>

#include "policies/perception.h"
#include "policies/visual_shape.h"

/// What `visual_pick` knows of its tasks before it sees anything: colours, shapes, heights, and how one picks and
/// places there. Nothing here depends on an initial state.
namespace evac {

/// A thing that can be found by its colour and shape.
struct Thing {
  ColourModel colour;
  Shape shape;               ///< what of it shows where it is looked for, base of the thing at z = 0
  double height_m = 0;       ///< where that base is, base frame
  double yaw_reach_rad = 0;  ///< its yaw may be thrice this off; 0: round, or no matter
};

/// One picture and where it was taken from.
struct View {
  const cv::Mat* rgb = nullptr;  ///< never null
  Camera camera;                 ///< of the picture's size
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
};

/// Where a thing is by earlier knowledge.
struct Prior {
  Placement placement;
  double within_m = 0;  ///< it is no further off than this
};

/// The thing in the picture, or nothing if too little of its colour is where it may be, or it has another shape.
/// Only pixels that may show it are looked at: the sky is no blue plate.
std::optional<ShapeFit> Locate(const View& view, const Thing& thing, const Prior& prior);

/// The share of a thing's silhouette that shows its colour, [0, 1]; 0 if it is out of the picture.
double VisibleShare(const View& view, const Thing& thing, const Eigen::Isometry3d& base_from_thing);

/// How to pick one thing and place it.
struct PickKnowledge {
  Thing thing;                  ///< as it stands at the beginning
  Shape held;                   ///< what shows of it beside the fingers while it hangs in the hand; empty: as it stands
  Prior usual;                  ///< where it is when nothing is seen
  double grasp_m = 0;           ///< height of the gripper at the grasp, base frame
  double hover_m = 0;           ///< height from which the wrist camera looks, base frame
  double lift_m = 0;            ///< how far it is lifted before it is carried
  double turn_rad = 0;          ///< yaw of the gripper relative to the thing's
  std::optional<Thing> target;  ///< what it is put on; none: a free place on the table
  Prior usual_target;           ///< that place, or where the target is when nothing is seen
  double target_floor_m = 0;    ///< height of what it is put on
  double target_rim_m = 0;      ///< from its middle to where two fingers can straddle its edge
  double drop_m = 0;            ///< gap below it when the hand opens
  double tilt_rad = 0;          ///< lean of the gripper when it lets go, its palm towards the robot
  double fall_m = 0;  ///< how far towards the robot its middle comes to lie from where its lower edge is put down
};

bool HasKnowledgeOf(const std::string& task_id);

/// @throws InvalidInput if `task_id` is none it knows.
PickKnowledge KnowledgeOf(const std::string& task_id);

}  // namespace evac
