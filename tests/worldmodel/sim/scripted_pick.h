#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/types.h"

/// A hand-written motion that knows where everything truly is: it shows that the tasks can be solved by friction alone.
/// Not a policy.
namespace evac::test {

struct Waypoint {
  ArmState arm;
  int periods = 1;  ///< how long the way there takes
};

inline const Eigen::Isometry3d& PoseIn(const PrivilegedFrame& frame, const std::string& body) {
  const auto found =
      std::find_if(frame.bodies.begin(), frame.bodies.end(), [&](const auto& b) { return b.name == body; });
  if (found == frame.bodies.end()) throw std::out_of_range("no body named " + body);
  return found->base_from_body;
}

inline double ForceIn(const PrivilegedFrame& frame, const std::string& a, const std::string& b) {
  for (const auto& contact : frame.contacts) {
    if (contact.a == a && contact.b == b) return contact.force_n;
  }
  return 0;
}

/// A gripper whose fingers open along `opening` (horizontal), pointing down and then tilted about its own x axis.
inline Eigen::Matrix3d Downward(const Eigen::Vector3d& opening, double tilt_rad = 0) {
  Eigen::Matrix3d base_from_gripper;
  base_from_gripper.col(2) = -Eigen::Vector3d::UnitZ();
  base_from_gripper.col(1) = Eigen::Vector3d(opening.x(), opening.y(), 0).normalized();
  base_from_gripper.col(0) = base_from_gripper.col(1).cross(base_from_gripper.col(2));
  return base_from_gripper * Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX()).toRotationMatrix();
}

inline ArmState At(const Eigen::Vector3d& position_m, const Eigen::Matrix3d& rotation, double closure) {
  ArmState arm{Eigen::Isometry3d::Identity(), closure};
  arm.base_from_gripper.translation() = position_m;
  arm.base_from_gripper.linear() = rotation;
  return arm;
}

/// Over `pick`, down, close, up, over `place`, down, open, up, home, rest.
struct PickAndPlace {
  Eigen::Vector3d pick_m, place_m;  ///< gripper origins
  Eigen::Matrix3d pick_rotation, place_rotation;
  ArmState home;
  double travel_z_m = 0.34;
  double hold_closure = 1.0;  ///< what the fingers are told when they should hold
};

inline std::vector<Waypoint> Plan(const PickAndPlace& p) {
  const auto over = [&](Eigen::Vector3d position_m) {
    position_m.z() = p.travel_z_m;
    return position_m;
  };
  const double hold = p.hold_closure;
  return {{At(over(p.pick_m), p.pick_rotation, 0), 14},
          {At(p.pick_m, p.pick_rotation, 0), 12},
          {At(p.pick_m, p.pick_rotation, 0), 3},
          {At(p.pick_m, p.pick_rotation, hold), 7},
          {At(over(p.pick_m), p.pick_rotation, hold), 12},
          {At(over(p.place_m), p.pick_rotation, hold), 14},
          {At(over(p.place_m), p.place_rotation, hold), 6},
          {At(p.place_m, p.place_rotation, hold), 14},
          {At(p.place_m, p.place_rotation, hold), 3},
          {At(p.place_m, p.place_rotation, 0), 5},
          {At(over(p.place_m), p.place_rotation, 0), 12},
          {p.home, 14},
          {p.home, 12}};
}

/// The bottle by its neck, then upright onto the free side of the table.
inline PickAndPlace PlanBottle(const PrivilegedFrame& frame, const ArmState& home) {
  const Eigen::Vector3d bottle_m = PoseIn(frame, "bottle").translation();
  PickAndPlace p;
  p.home = home;
  p.pick_rotation = p.place_rotation = home.base_from_gripper.linear();
  p.pick_m = bottle_m + Eigen::Vector3d(0, 0, 0.151);
  p.place_m = Eigen::Vector3d(0.44, 0.13, 0.151 + 0.002);
  return p;
}

/// The toast across its thin side; let go with its lower edge just over the plate, leaning, so that it tips onto the
/// middle.
inline PickAndPlace PlanToast(const PrivilegedFrame& frame, const ArmState& home) {
  constexpr double kTilt = 25 * std::numbers::pi / 180, kAboveCentreM = 0.024, kHalfHeightM = 0.040;
  const Eigen::Isometry3d toast = PoseIn(frame, "toast");
  PickAndPlace p;
  p.home = home;
  p.pick_rotation = Downward(toast.linear().col(0));
  p.place_rotation = Downward(toast.linear().col(0), kTilt);
  p.pick_m = toast.translation() + Eigen::Vector3d(0, 0, kAboveCentreM);
  const Eigen::Vector3d approach = p.place_rotation.col(2);
  const Eigen::Vector3d falls_towards = Eigen::Vector3d(-approach.x(), -approach.y(), 0).normalized();
  Eigen::Vector3d lower_edge_m = PoseIn(frame, "plate").translation() - kHalfHeightM * falls_towards;
  lower_edge_m.z() = 0.016;
  p.place_m = lower_edge_m - (kAboveCentreM + kHalfHeightM) * approach;
  return p;
}

/// How a flat thing with something standing up in its middle is taken by that, across its y axis.
struct Pinch {
  std::string thing, target;
  double above_thing_m, above_target_m;  ///< the gripper over the origins, at the grasp and when it lets go
};

inline PickAndPlace PlanPinch(const PrivilegedFrame& frame, const ArmState& home, const Pinch& pinch) {
  const Eigen::Isometry3d thing = PoseIn(frame, pinch.thing);
  PickAndPlace p;
  p.home = home;
  p.pick_rotation = p.place_rotation = Downward(thing.linear().col(1));
  p.pick_m = thing.translation() + Eigen::Vector3d(0, 0, pinch.above_thing_m);
  p.place_m = PoseIn(frame, pinch.target).translation() + Eigen::Vector3d(0, 0, pinch.above_target_m);
  return p;
}

/// The ham by its fold, down onto the bread.
inline PickAndPlace PlanHam(const PrivilegedFrame& frame, const ArmState& home) {
  return PlanPinch(frame, home, {"ham", "bread", 0.027, 0.048});
}

/// The leaf by its rib; let go over the middle of the bowl.
inline PickAndPlace PlanLettuce(const PrivilegedFrame& frame, const ArmState& home) {
  return PlanPinch(frame, home, {"leaf", "bowl", 0.027, 0.075});
}

/// One target per period: straight lines and slerp from waypoint to waypoint; fingers move at once.
inline std::vector<Arms> Targets(ArmState from, const std::vector<Waypoint>& waypoints) {
  std::vector<Arms> targets;
  for (const Waypoint& waypoint : waypoints) {
    const Eigen::Quaterniond start(from.base_from_gripper.linear()), end(waypoint.arm.base_from_gripper.linear());
    for (int k = 1; k <= waypoint.periods; ++k) {
      const double part = static_cast<double>(k) / waypoint.periods;
      const Eigen::Vector3d position_m =
          (1 - part) * from.base_from_gripper.translation() + part * waypoint.arm.base_from_gripper.translation();
      targets.push_back({At(position_m, start.slerp(part, end).toRotationMatrix(), waypoint.arm.closure)});
    }
    from = waypoint.arm;
  }
  return targets;
}

}  // namespace evac::test
