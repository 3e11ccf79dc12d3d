#pragma once

#include <filesystem>
#include <string>

namespace evac::sim {

/// How one MuJoCo world differs from the scene as it is written: the page profiles/NAME.yaml, field by field.
/// Everything random in it comes from streams seeded with the profile's name, so that two profiles share none.
struct Profile {
  std::string name;  ///< real, sim
  std::string hash;  ///< SHA-256 of the page's canonical text

  struct Physics {
    double pad_friction = 1;     ///< sliding friction of the finger pads against anything
    double object_friction = 1;  ///< factor on the sliding friction of everything else
    double mass = 1;             ///< factor on the mass and inertia of every free object
  } physics;

  struct Actuators {
    double gain = 1;   ///< factor on the position gains of the arm's joints
    double lag_s = 0;  ///< time constant of the first-order lag between the commanded and the driven joint angles
    double grip_force_n = 0;  ///< the most each finger presses
    double grip_speed = 0;    ///< closure per second
  } actuators;

  /// What the calibration does not know: drawn once per profile, normal with these deviations. It never changes between
  /// episodes.
  struct Calibration {
    int seed = 0;
    double camera_position_m =
        0;  ///< per axis, of every camera in its mount's frame (for the wrist camera: hand-eye error)
    double camera_rotation_deg = 0;  ///< per axis
    double joint_offset_deg = 0;     ///< per joint: zero of the encoder against the zero of the kinematics
  } calibration;

  /// Drawn anew for every frame.
  struct Sensors {
    double image_noise = 0;       ///< deviation in grey levels
    double arm_position_m = 0;    ///< per axis
    double arm_rotation_deg = 0;  ///< per axis
    double closure = 0;
  } sensors;

  struct Light {
    double strength = 1;  ///< factor on all lamps
    double ambient = 1;   ///< factor on the light that comes from everywhere
    double warmth = 0;    ///< red times 1 + warmth, blue times 1 - warmth
    bool shadows = true;
  } light;
};

/// @throws InvalidInput naming file, line, field, what was found and what was wanted. Every field must be there.
Profile ReadProfile(const std::filesystem::path& path);

}  // namespace evac::sim
