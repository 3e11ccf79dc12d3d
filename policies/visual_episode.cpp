#include "policies/visual_episode.h"

#include <numbers>

#include "core/error.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "policies/gripper_poses.h"

namespace evac {
namespace {

constexpr double kSettle_s = 0.1;    // at the grasp, before the hand closes
constexpr double kClosing_s = 0.55;  // from there until the thing is held
constexpr double kOpening_s = 0.4;
constexpr double kRetreat_m = 0.12;
constexpr double kArrived_m = 0.025;    // observed distance from where it should be, to trust the wrist's picture
constexpr double kBelievable_m = 0.06;  // a closer look that corrects more than this saw something else
constexpr double kEmptyShare = 0.15;    // of the held thing's silhouette that shows its colour

Eigen::Isometry3d Raised(const Eigen::Isometry3d& pose, double by_m) { return Eigen::Translation3d(0, 0, by_m) * pose; }

bool HasHeadCamera(const Task& task) {
  for (const Camera& camera : task.cameras) {
    if (camera.name == "head") return true;
  }
  return false;
}

Eigen::Vector2d Noise(SplitMix64& random, double sd_m) {
  const double x = random.Normal(), y = random.Normal();
  return sd_m * Eigen::Vector2d(x, y);
}

}  // namespace

VisualEpisode::VisualEpisode(const Task& task, const VisualPickOptions& options, std::uint64_t seed)
    : task_(task), options_(options), knowledge_(KnowledgeOf(task.id)), seed_(seed), retries_left_(options.retries) {
  if (!HasHeadCamera(task)) throw InvalidInput("visual_pick: task {} has no camera named head, wanted one", task.id);
  limits_.translation_mps *= options.speed;
  limits_.rotation_radps *= options.speed;
  SplitMix64 random(SeedFor(seed, "visual_pick episode"));
  blind_ = random.Uniform() < options.blindness;
  error_m_ = options.bias_m + Noise(random, options.noise_m);
  SplitMix64 random_place(SeedFor(seed, "visual_pick place"));
  place_error_m_ = Noise(random_place, options.place_noise_m);
  thing_ = knowledge_.usual.placement;
  target_ = knowledge_.usual_target.placement;
}

ActionChunk VisualEpisode::Answer(const Observation& observation) {
  const Glance glance = GlanceAt(observation);
  if (!plan_) {
    last_ = observation.arms.back();
    home_ = last_.base_from_gripper;
    if (observation.arms.size() == 2) left_ = Held(observation.arms.front());
    Look(glance);
    plan_ = Approach();
  } else if (ArrivedAbove(glance)) {
    LookCloser(glance);
    plan_ = Transfer(glance.error_m);
  } else if (HandIsEmpty(glance) && retries_left_ > 0) {
    --retries_left_;
    plan_ = Approach();
  }
  ActionChunk chunk;
  for (int k = 0; k < options_.chunk_size; ++k) {
    ++told_;
    last_ = {Inside(plan_->path.At(Clock()), task_.workspace_m), plan_->hand.At(Clock())};
    chunk.targets.push_back(left_ ? Arms{*left_, last_} : Arms{last_});
  }
  return chunk;
}

double VisualEpisode::Clock() const { return (told_ - plan_->begin) * task_.period_s; }

VisualEpisode::Glance VisualEpisode::GlanceAt(const Observation& observation) {
  SplitMix64 random(SeedFor(SeedFor(seed_, "visual_pick request"), static_cast<std::uint64_t>(requests_++)));
  const bool blind_now = random.Uniform() < options_.request_blindness;
  Glance glance;
  glance.base_from_gripper = observation.arms.back().base_from_gripper;
  glance.error_m = error_m_ + Noise(random, options_.request_noise_m);
  if (blind_ || blind_now) return glance;
  glance.head = ViewOf("head", task_, observation);
  glance.hand = ViewOf("hand_right", task_, observation);
  return glance;
}

void VisualEpisode::Look(const Glance& glance) {
  if (!glance.head) return;
  if (const auto fit = Locate(*glance.head, knowledge_.thing, knowledge_.usual)) thing_ = fit->placement;
  if (!knowledge_.target) return;
  if (const auto fit = Locate(*glance.head, *knowledge_.target, knowledge_.usual_target)) target_ = fit->placement;
}

void VisualEpisode::LookCloser(const Glance& glance) {
  if (!glance.hand) return;
  if (const auto fit = Locate(*glance.hand, knowledge_.thing, {thing_, kBelievable_m})) thing_ = fit->placement;
}

bool VisualEpisode::ArrivedAbove(const Glance& glance) const {
  if (plan_->transfers || Clock() < plan_->path.duration_s()) return false;
  const Eigen::Vector3d off_m = glance.base_from_gripper.translation() - plan_->path.At(Clock()).translation();
  const bool waited_long = Clock() > plan_->path.duration_s() + 2 * options_.chunk_size * task_.period_s;
  return off_m.norm() < kArrived_m || waited_long;
}

bool VisualEpisode::HandIsEmpty(const Glance& glance) {
  if (!plan_->transfers || plan_->checked || !glance.hand) return false;
  if (Clock() < plan_->lifted_s || Clock() > plan_->lowering_s) return false;
  plan_->checked = true;
  Thing held = knowledge_.thing;
  if (!knowledge_.held.empty()) held.shape = knowledge_.held;
  return VisibleShare(*glance.hand, held, glance.base_from_gripper * plan_->gripper_from_thing) < kEmptyShare;
}

VisualEpisode::Plan VisualEpisode::Approach() const {
  Plan plan{Timeline(last_.base_from_gripper, limits_), {}, told_};
  plan.hand = {last_.closure, std::nullopt, 0.0};
  plan.path.MoveTo(PointingDown(thing_.xy_m, knowledge_.hover_m, thing_.yaw_rad + knowledge_.turn_rad));
  return plan;
}

VisualEpisode::Plan VisualEpisode::Transfer(const Eigen::Vector2d& error_m) const {
  const Eigen::Vector2d thing_m = thing_.xy_m + error_m;
  const double yaw_rad = thing_.yaw_rad + knowledge_.turn_rad + options_.turn_deg * std::numbers::pi / 180;
  const double patience = 1 - options_.hurry;
  const Eigen::Isometry3d grasp = PointingDown(thing_m, knowledge_.grasp_m + options_.high_m, yaw_rad);
  const Eigen::Isometry3d release = Release();
  Plan plan{Timeline(last_.base_from_gripper, limits_), {}, told_};
  plan.transfers = true;
  plan.gripper_from_thing = grasp.inverse() * BaseFromObject({thing_m, thing_.yaw_rad}, knowledge_.thing.height_m);
  plan.path.MoveTo(PointingDown(thing_m, knowledge_.hover_m, yaw_rad));
  plan.path.MoveTo(grasp);
  plan.path.Pause(patience * kSettle_s);
  const double close_s = plan.path.duration_s();
  plan.path.Pause(patience * kClosing_s);
  plan.path.MoveTo(Raised(grasp, knowledge_.lift_m));
  plan.lifted_s = plan.path.duration_s();
  plan.path.MoveTo(Raised(release, knowledge_.lift_m));
  plan.lowering_s = plan.path.duration_s();
  plan.path.MoveTo(release);
  plan.path.Pause(patience * kSettle_s);
  const double open_s = plan.path.duration_s();
  plan.path.Pause(patience * kOpening_s);
  plan.path.MoveTo(release * Eigen::Translation3d(0, 0, -kRetreat_m));
  plan.path.MoveTo(home_);
  plan.hand = {last_.closure, close_s + options_.late_close_s, open_s - options_.early_release_s};
  return plan;
}

/// The thing's lower edge just above where it belongs, leaning so that its top falls towards the robot.
Eigen::Isometry3d VisualEpisode::Release() const {
  const double foot_m = knowledge_.grasp_m + options_.high_m - knowledge_.thing.height_m;  // below the gripper, in the hand
  const Eigen::Vector2d place_m = target_.xy_m + place_error_m_;
  Eigen::Isometry3d pose = PointingDown(place_m, 0, knowledge_.turn_rad);
  pose.linear() = Eigen::AngleAxisd(-knowledge_.tilt_rad, Eigen::Vector3d::UnitY()) * pose.linear();
  const Eigen::Vector3d lower_edge_m(place_m.x() + knowledge_.fall_m, place_m.y(),
                                     knowledge_.target_floor_m + knowledge_.drop_m);
  pose.translation() = lower_edge_m - foot_m * pose.linear().col(2);
  return pose;
}

}  // namespace evac
