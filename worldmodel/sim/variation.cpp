#include "worldmodel/sim/variation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "core/error.h"
#include "core/seed.h"
#include "worldmodel/sim/mujoco_handles.h"

namespace evac::sim {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

double Draw(SplitMix64& random, const Range& range) { return random.Uniform(range.low, range.high); }

void PlaceFreeBody(mjModel& model, int body, const Eigen::Isometry3d& base_from_body) {
  mjtNum* qpos = model.qpos0 + model.jnt_qposadr[model.body_jntadr[body]];
  const Eigen::Quaterniond q(base_from_body.linear());
  std::copy_n(base_from_body.translation().data(), 3, qpos);
  const double wxyz[4] = {q.w(), q.x(), q.y(), q.z()};
  std::copy(wxyz, wxyz + 4, qpos + 3);
}

void PlaceObjects(mjModel& model, const ScenePage& page, SplitMix64 random) {
  std::map<std::string, Eigen::Isometry3d> base_from_placed = {{"", Eigen::Isometry3d::Identity()}};
  for (const Placement& placement : page.placements) {
    const int body = IdOf(model, mjOBJ_BODY, placement.body);
    const auto around = base_from_placed.find(placement.inside);
    if (!IsFree(model, body) || around == base_from_placed.end()) {
      throw InvalidInput("{}: object '{}' inside '{}': wanted a body with a free joint, inside an earlier one",
                         page.scene.string(), placement.body, placement.inside);
    }
    Eigen::Isometry3d around_from_body = Eigen::Isometry3d::Identity();
    const double x_m = Draw(random, placement.x_m), y_m = Draw(random, placement.y_m);
    around_from_body.translation() = Vector3d(x_m, y_m, placement.z_m);
    around_from_body.rotate(Eigen::AngleAxisd(Draw(random, placement.yaw_deg) * kDegree, Vector3d::UnitZ()));
    const Eigen::Isometry3d base_from_body = around->second * around_from_body;
    PlaceFreeBody(model, body, base_from_body);
    base_from_placed[placement.body] = base_from_body;
  }
}

/// RGB in [0, 1] with its hue turned, saturation and value scaled.
Vector3d Recoloured(const Vector3d& rgb, double hue_deg, double saturation, double value) {
  const double high = rgb.maxCoeff();
  const double grey = high * (1 - std::min(1.0, saturation));  // towards grey, or away from it
  Vector3d pure = saturation <= 1 ? Vector3d(grey * Vector3d::Ones() + saturation * rgb)
                                  : Vector3d(high * Vector3d::Ones() - saturation * (high * Vector3d::Ones() - rgb));
  // Turning about the grey axis by Rodrigues' formula keeps the sum and, for small angles, the impression of
  // brightness.
  pure = Eigen::AngleAxisd(hue_deg * kDegree, Vector3d::Ones().normalized()) * pure;
  return (value * pure).cwiseMax(0.0).cwiseMin(1.0);
}

void Colour(mjModel& model, const std::vector<ColourVariation>& variations, SplitMix64 random) {
  for (const ColourVariation& variation : variations) {
    const double hue_deg = Draw(random, variation.hue_deg);
    const double saturation = Draw(random, variation.saturation);
    const double value = Draw(random, variation.value);
    for (const std::string& material : variation.materials) {
      Eigen::Map<Eigen::Vector3f> rgb(model.mat_rgba + 4 * IdOf(model, mjOBJ_MATERIAL, material));
      rgb = Recoloured(rgb.cast<double>(), hue_deg, saturation, value).cast<float>();
    }
  }
}

void ScaleLight(Eigen::Map<Eigen::Vector3f> rgb, double strength, double warmth) {
  rgb = rgb.cwiseProduct(Eigen::Vector3f(1 + warmth, 1, 1 - warmth)) * static_cast<float>(strength);
}

void ScaleLights(mjModel& model, double strength, double ambient, double warmth) {
  for (int i = 0; i < model.nlight; ++i)
    ScaleLight(Eigen::Map<Eigen::Vector3f>(model.light_diffuse + 3 * i), strength, warmth);
  ScaleLight(Eigen::Map<Eigen::Vector3f>(model.vis.headlight.diffuse), strength, warmth);
  ScaleLight(Eigen::Map<Eigen::Vector3f>(model.vis.headlight.ambient), ambient, warmth);
}

void VaryLight(mjModel& model, const LightVariation& light, SplitMix64 random) {
  const double strength = Draw(random, light.strength);
  const Eigen::AngleAxisd turn(Draw(random, light.azimuth_deg) * kDegree, Vector3d::UnitZ());
  const double warmth = Draw(random, light.warmth);
  ScaleLights(model, strength, strength, warmth);
  for (int i = 0; i < model.nlight; ++i) {
    Eigen::Map<Vector3d> direction(model.light_dir + 3 * i);
    direction = turn * Vector3d(direction);
  }
}

void Scatter(mjModel& model, const Clutter& clutter, SplitMix64 random) {
  std::vector<Eigen::Vector2d> places_m = clutter.places_m;
  for (const std::string& name : clutter.bodies) {
    const int body = IdOf(model, mjOBJ_BODY, name);
    if (IsOfThing(model, body))
      throw InvalidInput("scene {}: clutter '{}' is free to move, wanted a fixed body (free ones are `objects`)",
                         model.names, name);
    const std::size_t chosen = random.Below(places_m.size());
    const double y = random.Uniform(-1, 1);  // before x: states are what they were drawn as first
    const double x = random.Uniform(-1, 1);
    const Eigen::Vector2d jitter_m(x, y);
    const double half_yaw = random.Uniform(-std::numbers::pi, std::numbers::pi) / 2;
    const bool there = random.Uniform() < clutter.chance;
    const Eigen::Vector2d place_m = places_m[chosen] + clutter.spread_m * jitter_m;
    places_m.erase(places_m.begin() + static_cast<std::ptrdiff_t>(chosen));
    Eigen::Map<Vector3d>(model.body_pos + 3 * body) =
        Vector3d(place_m.x(), place_m.y(), there ? 0.0 : -5.0);  // or under the floor
    Eigen::Map<Eigen::Vector4d>(model.body_quat + 4 * body) =
        Eigen::Vector4d(std::cos(half_yaw), 0, 0, std::sin(half_yaw));
  }
}

void ScaleMass(mjModel& model, double factor) {
  for (int body = 1; body < model.nbody; ++body) {
    if (!IsOfThing(model, body)) continue;
    model.body_mass[body] *= factor;
    Eigen::Map<Vector3d>(model.body_inertia + 3 * body) *= factor;
  }
}

void SetFriction(mjModel& model, const Profile::Physics& physics) {
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const bool is_pad = NameOf(model, mjOBJ_GEOM, geom).find("pad_") != std::string::npos;
    mjtNum& sliding = model.geom_friction[3 * geom];
    sliding = is_pad ? physics.pad_friction : sliding * physics.object_friction;
  }
}

void SetActuators(mjModel& model, const Profile::Actuators& actuators) {
  for (int i = 0; i < model.nu; ++i) {
    if (NameOf(model, mjOBJ_ACTUATOR, i).ends_with("grip")) {
      // The tendon is the mean of both fingers' travel: each finger gets half of the actuator's force.
      model.actuator_forcerange[2 * i] = -2 * actuators.grip_force_n;
      model.actuator_forcerange[2 * i + 1] = 2 * actuators.grip_force_n;
    } else {
      model.actuator_gainprm[mjNGAIN * i] *= actuators.gain;
      model.actuator_biasprm[mjNBIAS * i + 1] *= actuators.gain;
    }
  }
}

}  // namespace

void ApplyInitialState(mjModel& model, const ScenePage& page, std::uint64_t seed) {
  PlaceObjects(model, page, SplitMix64(SeedFor(seed, "objects")));
  Colour(model, page.colours, SplitMix64(SeedFor(seed, "colours")));
  VaryLight(model, page.light, SplitMix64(SeedFor(seed, "light")));
  Scatter(model, page.clutter, SplitMix64(SeedFor(seed, "clutter")));
}

Eigen::Isometry3d InitialPose(const mjModel& model, const std::string& name) {
  const int body = IdOf(model, mjOBJ_BODY, name);
  if (!IsFree(model, body)) throw InvalidInput("scene {}: '{}' has no free joint, wanted one", model.names, name);
  const mjtNum* qpos = model.qpos0 + model.jnt_qposadr[model.body_jntadr[body]];
  Eigen::Isometry3d base_from_body = Eigen::Isometry3d::Identity();
  base_from_body.translation() = Eigen::Map<const Vector3d>(qpos);
  base_from_body.linear() = Eigen::Quaterniond(qpos[3], qpos[4], qpos[5], qpos[6]).toRotationMatrix();
  return base_from_body;
}

void ApplyProfile(mjModel& model, const Profile& profile) {
  ScaleMass(model, profile.physics.mass);
  SetFriction(model, profile.physics);
  SetActuators(model, profile.actuators);
  ScaleLights(model, profile.light.strength, profile.light.ambient, profile.light.warmth);
  if (!profile.light.shadows) std::fill(model.light_castshadow, model.light_castshadow + model.nlight, mjtByte{0});
}

}  // namespace evac::sim
