#pragma once

#include <array>
#include <filesystem>
#include <string>

namespace evac {

/// Mean and standard deviation of a robot's motion from one frame to the next at 30 Hz: left xyz (metres), left roll
/// pitch yaw (radians), then right.
struct ActionStatistics {
  std::string robot;
  std::array<double, 12> mean{}, deviation{};
};

/// What the released model was trained with (spec 1.3).
ActionStatistics AgiBotWorldStatistics();

/// A page with `robot`, `mean` and `deviation`: one per robot, in configs/robots.
/// @throws InvalidInput naming file and field: not 12 numbers, not finite, a deviation that is not positive.
ActionStatistics ReadActionStatistics(const std::filesystem::path& path);

}  // namespace evac
