#include "worldmodel/motion_statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "worldmodel/action_delta.h"

namespace evac {
namespace {

constexpr double kLeast_m = 1e-5, kLeast_rad = 1e-4;  // per frame; below it a deviation is rounding

std::string List(const std::array<double, 12>& values) {
  std::string text;
  for (const double value : values) text += fmt::format("{}{}", text.empty() ? "" : ", ", value);
  return "[" + text + "]";
}

/// As YAML takes it for that text: in quotes where it is not a plain word.
std::string Scalar(const std::string& text) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.'; };
  const bool is_word = !text.empty() && std::isalpha(static_cast<unsigned char>(text.front())) != 0;
  if (is_word && std::ranges::all_of(text, is_plain)) return text;
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

void MotionSums::Add(const std::vector<Arms>& track) {
  for (std::size_t step = 1; step < track.size(); ++step) {
    const ActionDelta delta = DeltaBetween(GrippersOf(track[step - 1]), GrippersOf(track[step]));
    for (std::size_t i = 0; i < 12; ++i) {
      const double value = delta[i / 6 * 7 + i % 6];
      sum_[i] += value;
      squares_[i] += value * value;
    }
    steps_ += 1;
  }
}

void LagSums::Add(const std::vector<Arms>& told, const std::vector<Arms>& measured) {
  for (std::size_t k = 1; k < std::min(told.size(), measured.size()); ++k) {
    for (std::size_t arm = 0; arm < std::min(told[k].size(), measured[k].size()); ++arm) {
      const Eigen::Vector3d now = told[k][arm].base_from_gripper.translation(),
                            step = now - told[k - 1].at(arm).base_from_gripper.translation();
      behind_m2 += step.dot(now - measured[k][arm].base_from_gripper.translation());
      step_m2 += step.squaredNorm();
    }
  }
}

void LagSums::Add(const LagSums& other) {
  behind_m2 += other.behind_m2;
  step_m2 += other.step_m2;
}

std::optional<double> LagSums::Frames() const {
  if (step_m2 < 1e-8) return std::nullopt;
  return behind_m2 / step_m2;
}

ActionStatistics MotionSums::Statistics(const std::string& robot, double delta_frames) const {
  ActionStatistics statistics;
  statistics.robot = robot;
  for (std::size_t i = 0; i < 12; ++i) {
    const double mean = steps_ > 0 ? sum_[i] / steps_ : 0;
    const double variance = steps_ > 0 ? squares_[i] / steps_ - mean * mean : 0;
    const bool moves = squares_[i] > 0;
    const double least = i % 6 < 3 ? kLeast_m : kLeast_rad;
    statistics.mean[i] = mean / delta_frames;
    statistics.deviation[i] = moves ? std::max(least, std::sqrt(std::max(0.0, variance)) / delta_frames) : 1;
  }
  return statistics;
}

std::string StatisticsPage(const ActionStatistics& statistics) {
  return fmt::format(
      "# Motion per frame of 30 Hz: left x, y, z (metres), roll, pitch, yaw (radians), then right. An arm that never "
      "moved: 0 and 1.\nrobot: {}\nmean: {}\ndeviation: {}\n",
      Scalar(statistics.robot), List(statistics.mean), List(statistics.deviation));
}

}  // namespace evac
