#include "worldmodel/sim/profile.h"

#include <cmath>

#include "core/config.h"
#include "core/hash.h"

namespace evac::sim {
namespace {

double ReadBetween(const Config& page, const std::string& key, double low, double high) {
  const auto value = page.Get<double>(key);
  page.Require(value >= low && value <= high, key, fmt::format("a number from {} to {}", low, high));
  return value;
}

Profile::Physics ReadPhysics(const Config& page) {
  page.AllowOnly({"pad_friction", "object_friction", "mass"});
  return {ReadBetween(page, "pad_friction", 0, 5), ReadBetween(page, "object_friction", 0, 5),
          ReadBetween(page, "mass", 0.05, 20)};
}

Profile::Actuators ReadActuators(const Config& page) {
  page.AllowOnly({"gain", "lag_s", "grip_force_n", "grip_speed"});
  return {ReadBetween(page, "gain", 0.1, 4), ReadBetween(page, "lag_s", 0, 1),
          ReadBetween(page, "grip_force_n", 0, 100), ReadBetween(page, "grip_speed", 0.1, 20)};
}

Profile::Calibration ReadCalibration(const Config& page) {
  page.AllowOnly({"seed", "camera_position_m", "camera_rotation_deg", "joint_offset_deg"});
  return {page.Get<int>("seed"), ReadBetween(page, "camera_position_m", 0, 0.2),
          ReadBetween(page, "camera_rotation_deg", 0, 30), ReadBetween(page, "joint_offset_deg", 0, 10)};
}

Profile::Sensors ReadSensors(const Config& page) {
  page.AllowOnly({"image_noise", "arm_position_m", "arm_rotation_deg", "closure"});
  return {ReadBetween(page, "image_noise", 0, 100), ReadBetween(page, "arm_position_m", 0, 0.1),
          ReadBetween(page, "arm_rotation_deg", 0, 30), ReadBetween(page, "closure", 0, 0.5)};
}

Profile::Light ReadLight(const Config& page) {
  page.AllowOnly({"strength", "ambient", "warmth", "shadows"});
  return {ReadBetween(page, "strength", 0, 4), ReadBetween(page, "ambient", 0, 4),
          ReadBetween(page, "warmth", -0.5, 0.5), page.Get<bool>("shadows")};
}

}  // namespace

Profile ReadProfile(const std::filesystem::path& path) {
  const Config page = Config::FromFile(path);
  page.AllowOnly({"name", "physics", "actuators", "calibration", "sensors", "light"});
  Profile profile;
  profile.name = page.Get<std::string>("name");
  profile.hash = Sha256Hex(page.Canonical());
  profile.physics = ReadPhysics(page.Section("physics"));
  profile.actuators = ReadActuators(page.Section("actuators"));
  profile.calibration = ReadCalibration(page.Section("calibration"));
  profile.sensors = ReadSensors(page.Section("sensors"));
  profile.light = ReadLight(page.Section("light"));
  return profile;
}

}  // namespace evac::sim
