#include "worldmodel/sim/arm_control.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"

namespace evac::sim {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using RowMatrix3Xd = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kFingerTravelM = 0.04;  // per finger, closure 0
constexpr double kJointSpeed = 2.5;      // rad/s
constexpr double kDamping = 0.02;        // of the least squares
constexpr int kIterations = 60;
constexpr double kSolved = 1e-5;  // metres and radians together
const Joints kPosture =
    (Joints() << 0.0, -0.10, 2.2, 0.0, 1.05, 0.0).finished();  // elbow up, gripper down: where solving starts

/// Position error and rotation vector, both in the base frame, that lead from one pose to the other.
Vector6d Difference(const Eigen::Isometry3d& to, const Eigen::Isometry3d& from) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.linear() * from.linear().transpose()));
  Vector6d difference;
  difference << to.translation() - from.translation(), turn.angle() * turn.axis();
  return difference;
}

}  // namespace

ArmControl::ArmControl(const mjModel& model, const std::string& arm, const Profile::Actuators& actuators,
                       const Joints& joint_offset)
    : model_(&model), scratch_(MakeData(model)), actuators_(actuators), joint_offset_(joint_offset) {
  const std::string prefix = NamePrefix(arm);
  for (int i = 0; i < kJoints; ++i) {
    const std::string name = fmt::format("{}j{}", prefix, i + 1);
    const int joint = IdOf(model, mjOBJ_JOINT, name);
    qpos_[i] = model.jnt_qposadr[joint];
    dof_[i] = model.jnt_dofadr[joint];
    actuator_[i] = IdOf(model, mjOBJ_ACTUATOR, name);
    low_[i] = model.jnt_range[2 * joint];
    high_[i] = model.jnt_range[2 * joint + 1];
  }
  const char* fingers[] = {"finger_left", "finger_right"};
  for (int i = 0; i < 2; ++i) {
    const int joint = IdOf(model, mjOBJ_JOINT, prefix + fingers[i]);
    finger_qpos_[i] = model.jnt_qposadr[joint];
    finger_dof_[i] = model.jnt_dofadr[joint];
  }
  grip_ = IdOf(model, mjOBJ_ACTUATOR, prefix + "grip");
  site_ = IdOf(model, mjOBJ_SITE, prefix + "gripper");
}

void ArmControl::StartAt(mjData& data, const ArmState& home) {
  double error = 0;
  reference_ = driven_ = Solve(home.base_from_gripper, kPosture, &error);
  if (error > 1e-3)
    throw InvalidInput("the home pose cannot be reached: the arm stays {} (metres and radians) away", error);
  step_.setZero();
  closure_ = home.closure;
  closure_step_ = 0;
  for (int i = 0; i < kJoints; ++i) data.qpos[qpos_[i]] = reference_[i] - joint_offset_[i];
  for (const int finger : finger_qpos_) data.qpos[finger] = kFingerTravelM * (1 - closure_);
}

void ArmControl::Aim(const ArmState& target, int steps) {
  const double most = kJointSpeed * steps * model_->opt.timestep;
  const Joints goal = Solve(target.base_from_gripper, reference_, nullptr);
  const Joints change = goal - reference_;
  const double largest = change.cwiseAbs().maxCoeff();
  step_ = change * (largest > most ? most / largest : 1.0) / steps;
  const double most_closing = actuators_.grip_speed * steps * model_->opt.timestep;
  closure_step_ = std::clamp(std::clamp(target.closure, 0.0, 1.0) - closure_, -most_closing, most_closing) / steps;
  steps_left_ = steps;
}

void ArmControl::Actuate(mjData& data) {
  if (steps_left_ > 0) {
    reference_ += step_;
    closure_ += closure_step_;
    --steps_left_;
  }
  const double follow = model_->opt.timestep / (actuators_.lag_s + model_->opt.timestep);
  driven_ += follow * (reference_ - driven_);
  for (int i = 0; i < kJoints; ++i) {
    data.ctrl[actuator_[i]] = driven_[i] - joint_offset_[i];
    data.qfrc_applied[dof_[i]] = data.qfrc_bias[dof_[i]];  // gravity and Coriolis compensation
  }
  for (const int dof : finger_dof_) data.qfrc_applied[dof] = data.qfrc_bias[dof];
  data.ctrl[grip_] = kFingerTravelM * (1 - closure_);
}

Eigen::Isometry3d ArmControl::TrueGripper(const mjData& data) const {
  return PoseOf(data.site_xpos + 3 * site_, data.site_xmat + 9 * site_);
}

ArmState ArmControl::Measured(const mjData& data) {
  const double travel_m = (data.qpos[finger_qpos_[0]] + data.qpos[finger_qpos_[1]]) / 2;
  return {Forward(Encoders(data)), std::clamp(1 - travel_m / kFingerTravelM, 0.0, 1.0)};
}

Joints ArmControl::Encoders(const mjData& data) const {
  Joints joints;
  for (int i = 0; i < kJoints; ++i) joints[i] = data.qpos[qpos_[i]] + joint_offset_[i];
  return joints;
}

Eigen::Isometry3d ArmControl::Forward(const Joints& joints) {
  for (int i = 0; i < kJoints; ++i) scratch_->qpos[qpos_[i]] = joints[i];
  mj_kinematics(model_, scratch_.get());
  return PoseOf(scratch_->site_xpos + 3 * site_, scratch_->site_xmat + 9 * site_);
}

Joints ArmControl::Solve(const Eigen::Isometry3d& base_from_gripper, Joints joints, double* error) {
  RowMatrix3Xd linear(3, model_->nv), angular(3, model_->nv);
  Eigen::Matrix<double, 6, kJoints> jacobian;
  Vector6d difference = Difference(base_from_gripper, Forward(joints));
  for (int k = 0; k < kIterations && difference.norm() > kSolved; ++k) {
    mj_comPos(model_, scratch_.get());
    mj_jacSite(model_, scratch_.get(), linear.data(), angular.data(), site_);
    for (int i = 0; i < kJoints; ++i) jacobian.col(i) << linear.col(dof_[i]), angular.col(dof_[i]);
    const Eigen::Matrix<double, 6, 6> damped =
        jacobian * jacobian.transpose() + kDamping * kDamping * Eigen::Matrix<double, 6, 6>::Identity();
    Joints change = jacobian.transpose() * damped.ldlt().solve(difference);
    change *= std::min(1.0, 0.4 / std::max(1e-12, change.cwiseAbs().maxCoeff()));
    joints = (joints + change).cwiseMax(low_).cwiseMin(high_);
    difference = Difference(base_from_gripper, Forward(joints));
  }
  if (error) *error = difference.norm();
  return joints;
}

}  // namespace evac::sim
