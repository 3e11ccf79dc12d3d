#include "worldmodel/sim/scene.h"

#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "worldmodel/sim/privileged.h"
#include "worldmodel/sim/variation.h"

namespace evac::sim {
namespace {

constexpr double kSettleS = 0.2;  // objects are placed a hair above what they stand on

ModelPtr VariedModel(const Scene::Setup& setup) {
  ModelPtr model = CopyModel(*setup.base);
  ApplyInitialState(*model, *setup.page, setup.initial.seed);
  ApplyProfile(*model, *setup.profile);
  return model;
}

int StepsPerPeriod(const Task& task, const mjModel& model) {
  const double steps = task.period_s / model.opt.timestep;
  if (std::abs(steps - std::round(steps)) > 1e-6) {
    throw InvalidInput("{}: period_s is {}, wanted a multiple of the scene's {} s", task.page_path, task.period_s,
                       model.opt.timestep);
  }
  return static_cast<int>(std::round(steps));
}

/// A function of (task, initial state, seed) and the profile's name: never of the policy or of the other scenes.
std::uint64_t NoiseSeed(const Scene::Setup& setup) {
  const std::uint64_t of_episode = SeedFor(SeedFor(setup.seed, setup.task.id), setup.initial.seed);
  return SeedFor(of_episode, "sensors of " + setup.profile->name);
}

}  // namespace

Scene::Scene(Setup setup)
    : setup_(std::move(setup)),
      errors_(DrawHiddenErrors(*setup_.profile, setup_.task)),
      model_(VariedModel(setup_)),
      data_(MakeData(*model_)),
      steps_per_period_(StepsPerPeriod(setup_.task, *model_)),
      noise_seed_(NoiseSeed(setup_)) {
  for (const Camera& camera : setup_.task.cameras) RefuseUndrawable(camera);
  StartArms();
  const int settle_steps = static_cast<int>(kSettleS / model_->opt.timestep);
  for (int i = 0; i < settle_steps; ++i) StepPhysics();
}

void Scene::StartArms() {
  const Task& task = setup_.task;
  if (HasArm(*model_, "left") != (task.arms.size() == 2)) {
    throw InvalidInput("{}: found {} arms, wanted {}: those of the scene", task.page_path, task.arms.size(),
                       HasArm(*model_, "left") ? "[left, right]" : "[right]");
  }
  for (std::size_t i = 0; i < task.arms.size(); ++i) {
    const Home& home = setup_.page->homes.at(i);
    const Eigen::Isometry3d base_from_around =
        home.inside.empty() ? Eigen::Isometry3d::Identity() : InitialPose(*model_, home.inside);
    controls_.emplace_back(*model_, task.arms[i], setup_.profile->actuators, errors_.joint_offset[i]);
    controls_.back().StartAt(*data_, {base_from_around * home.around_from_gripper, home.closure});
  }
}

void Scene::Drive(const Arms& target) {
  for (std::size_t i = 0; i < controls_.size(); ++i) controls_[i].Aim(target[i], steps_per_period_);
  for (int i = 0; i < steps_per_period_; ++i) StepPhysics();
}

void Scene::StepPhysics() {
  mj_step1(model_.get(), data_.get());
  for (ArmControl& control : controls_) control.Actuate(*data_);
  mj_step2(model_.get(), data_.get());
}

WorldStep Scene::Observe(Renderer* renderer) {
  mj_forward(model_.get(), data_.get());  // poses and contacts of the state just reached
  WorldStep step;
  step.privileged = ReadPrivileged(*model_, *data_);
  const Arms arms = TrueArms();
  const std::uint64_t frame_seed = SeedFor(noise_seed_, frame_++);
  if (renderer) step.observation.images = Pictures(*renderer, arms, frame_seed);
  for (std::size_t i = 0; i < controls_.size(); ++i) {
    ArmState& arm = step.observation.arms.emplace_back(controls_[i].Measured(*data_));
    const bool is_left = setup_.task.arms[i] == "left";
    AddNoise(arm, setup_.profile->sensors, SeedFor(frame_seed, is_left ? "left arm" : "arm"));
  }
  return step;
}

std::vector<cv::Mat> Scene::Pictures(Renderer& renderer, const Arms& arms, std::uint64_t frame_seed) {
  const std::vector<Camera>& cameras = setup_.task.cameras;
  std::vector<SceneView> views;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    views.push_back({cameras[i], BaseFromCamera(cameras[i], arms) * errors_.camera_from_true_camera[i]});
  std::vector<cv::Mat> pictures = renderer.Draw(*setup_.base, *model_, *data_, views);
  for (std::size_t i = 0; i < cameras.size(); ++i)
    AddNoise(pictures[i], setup_.profile->sensors.image_noise, SeedFor(frame_seed, "image " + cameras[i].name));
  return pictures;
}

Arms Scene::TrueArms() const {
  Arms arms;
  for (const ArmControl& control : controls_) arms.push_back({control.TrueGripper(*data_), 0.0});
  return arms;
}

std::optional<std::string> Scene::WhyDiverged() const {
  static constexpr std::pair<int, const char*> kSerious[] = {
      {mjWARN_BADQPOS, "positions are not finite or too large"},
      {mjWARN_BADQVEL, "velocities are not finite or too large"},
      {mjWARN_BADQACC, "accelerations are not finite or too large"},
      {mjWARN_BADCTRL, "controls are not finite"},
      {mjWARN_CONTACTFULL, "more contacts than there is room for"},
      {mjWARN_CNSTRFULL, "more constraints than there is room for"}};
  for (const auto& [warning, words] : kSerious) {
    if (data_->warning[warning].number > 0)
      return fmt::format("physics diverged before {:.2f} s: {}", data_->time, words);
  }
  return std::nullopt;
}

}  // namespace evac::sim
