#pragma once

#include <Eigen/Dense>
#include <string>

#include "core/types.h"
#include "worldmodel/sim/mujoco_handles.h"
#include "worldmodel/sim/profile.h"

namespace evac::sim {

constexpr int kJoints = 6;
using Joints = Eigen::Matrix<double, kJoints, 1>;  ///< radians, base to wrist

/// Drives one arm of the scene (joints j1 … j6, site `gripper`, fingers) from gripper targets: damped least squares
/// inverse kinematics (Wampler 1986), a straight line in joint angles through each period, gravity compensation, a lag.
///
/// The controller believes in the nominal kinematics; the true joints are off by `joint_offset` (encoder zeros), so
/// both where it goes and where it says it is are off together, as on a real robot.
class ArmControl {
 public:
  /// @param arm           "right" or "left": the left arm's names in the scene begin with `left_`.
  /// @param joint_offset  believed minus true angle, per joint.
  ArmControl(const mjModel& model, const std::string& arm, const Profile::Actuators& actuators,
             const Joints& joint_offset);

  /// Puts the arm's joints into `data` so that it believes to be at `home`, fingers there too, and holds it.
  /// @throws InvalidInput if the pose cannot be reached.
  void StartAt(mjData& data, const ArmState& home);

  /// Aims at a target that is due in `steps` physics steps. A target out of reach or too fast is followed as well as
  /// the joints' limits and speed allow.
  void Aim(const ArmState& target, int steps);

  /// One physics step's controls. Call between mj_step1 and mj_step2.
  void Actuate(mjData& data);

  /// Where the gripper truly is, once the kinematics of `data` are computed.
  Eigen::Isometry3d TrueGripper(const mjData& data) const;

  /// Where the arm believes to be: forward kinematics of its encoders.
  ArmState Measured(const mjData& data);

 private:
  Joints Solve(const Eigen::Isometry3d& base_from_gripper, Joints joints, double* error);
  Eigen::Isometry3d Forward(const Joints& joints);
  Joints Encoders(const mjData& data) const;

  const mjModel* model_;
  DataPtr scratch_;  ///< for kinematics of joint angles that are not the scene's
  Profile::Actuators actuators_;
  Joints joint_offset_;
  int qpos_[kJoints], dof_[kJoints], actuator_[kJoints];
  int finger_qpos_[2], finger_dof_[2], grip_ = 0, site_ = 0;
  Joints low_, high_;

  Joints reference_ = Joints::Zero(), step_ = Joints::Zero(), driven_ = Joints::Zero();
  double closure_ = 0, closure_step_ = 0;
  int steps_left_ = 0;
};

}  // namespace evac::sim
