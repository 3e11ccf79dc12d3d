#pragma once

#include <array>
#include <filesystem>
#include <string>

namespace evac {

inline constexpr double kStatisticsFrames_hz = 30;  ///< of the recordings that motion statistics are per frame of

/// Mean and standard deviation of a robot's motion from one frame to the next at 30 Hz: left xyz (metres), left roll
/// pitch yaw (radians), then right.
struct ActionStatistics {
  std::string robot;
  std::array<double, 12> mean{}, deviation{};
};

/// What the released model was trained with: the reference's numbers (docs/evac_quirks.md).
ActionStatistics AgiBotWorldStatistics();

/// A page with `robot`, `mean` and `deviation`: one per robot, in apps/configs/robots.
/// @throws InvalidInput naming file and field: not 12 numbers, not finite, a deviation that is not positive.
ActionStatistics ReadActionStatistics(const std::filesystem::path& path);
/// The same of a text that stands elsewhere. @param name  stands for the file in messages
ActionStatistics ParseActionStatistics(const std::string& text, const std::string& name);

}  // namespace evac
