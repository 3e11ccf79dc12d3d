#include "worldmodel/sim/scene.h"

#include <algorithm>
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
      errors_(DrawHiddenErrors(*setup_.profile, setup_.task.cameras)),
      model_(VariedModel(setup_)),
      data_(MakeData(*model_)),
      control_(*model_, setup_.profile->actuators, errors_.joint_offset),
      steps_per_period_(StepsPerPeriod(setup_.task, *model_)),
      noise_seed_(NoiseSeed(setup_)) {
  if (setup_.task.arms != std::vector<std::string>{"right"}) {
    throw InvalidInput("{}: found {} arms, wanted [right]: the scene has one", setup_.task.page_path,
                       setup_.task.arms.size());
  }
  for (const Camera& camera : setup_.task.cameras) RefuseUndrawable(camera);
  control_.StartAt(*data_, {setup_.page->base_from_home, 0.0});
  const int settle_steps = static_cast<int>(kSettleS / model_->opt.timestep);
  for (int i = 0; i < settle_steps; ++i) StepPhysics();
}

void Scene::Drive(const Arms& target) {
  control_.Aim(target.front(), steps_per_period_);
  for (int i = 0; i < steps_per_period_; ++i) StepPhysics();
}

void Scene::StepPhysics() {
  mj_step1(model_.get(), data_.get());
  control_.Actuate(*data_);
  mj_step2(model_.get(), data_.get());
}

WorldStep Scene::Observe(Renderer& renderer) {
  mj_forward(model_.get(), data_.get());  // poses and contacts of the state just reached
  WorldStep step;
  step.privileged = ReadPrivileged(*model_, *data_);
  const Eigen::Isometry3d& base_from_gripper =
      std::find_if(step.privileged.bodies.begin(), step.privileged.bodies.end(), [](const auto& body) {
        return body.name == "gripper";
      })->base_from_body;
  const std::uint64_t frame_seed = SeedFor(noise_seed_, frame_++);
  for (std::size_t i = 0; i < setup_.task.cameras.size(); ++i) {
    const Camera& camera = setup_.task.cameras[i];
    const Eigen::Isometry3d base_from_camera =
        BaseFromCamera(camera, {{base_from_gripper, 0.0}}) * errors_.camera_from_true_camera[i];
    step.observation.images.push_back(renderer.Draw(*setup_.base, *model_, *data_, camera, base_from_camera));
    AddNoise(step.observation.images.back(), setup_.profile->sensors.image_noise,
             SeedFor(frame_seed, "image " + camera.name));
  }
  step.observation.arms = {control_.Measured(*data_)};
  AddNoise(step.observation.arms.front(), setup_.profile->sensors, SeedFor(frame_seed, "arm"));
  return step;
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
