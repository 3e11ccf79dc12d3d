#include "apps/variation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace evac {
namespace {

constexpr double kUnchanged = 0.1, kElsewhere = 0.7, kTurned = 0.3, kOtherTime = 0.5;
constexpr double kTurn_deg = 12;
constexpr int kReach = 12, kLift = 6, kEarliest = -4, kLatest = 4;  // frames: a hand goes there, and lifts

/// Of narrow errors and wide ones as many.
Eigen::Vector3d Away_m(SplitMix64& random) {
  const bool wide = random.Uniform() < 0.5;
  const double across_m = wide ? 0.012 : 0.004, up_m = wide ? 0.006 : 0.003;
  const double z_m = up_m * random.Normal();  // before y and x: variations are what they were drawn as first
  const double y_m = across_m * random.Normal();
  const double x_m = across_m * random.Normal();
  Eigen::Vector3d away_m(x_m, y_m, z_m);
  if (random.Uniform() >= kElsewhere) away_m.setZero();
  return away_m;
}

int OtherTime(SplitMix64& random) {
  const int shift = kEarliest + static_cast<int>(random.Below(kLatest - kEarliest + 1));
  return random.Uniform() < kOtherTime ? shift : 0;
}

/// 0 up to `from`, 1 from `to` on, smooth between.
double Risen(int t, int from, int to) {
  const double x = std::clamp(static_cast<double>(t - from) / std::max(1, to - from), 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

bool IsClosed(const Arms& arms) { return arms.back().closure > 0.5; }

/// The frames at which the hand is told to close.
std::vector<int> Closings(std::span<const Arms> told) {
  std::vector<int> frames;
  for (std::size_t t = 1; t < told.size(); ++t) {
    if (IsClosed(told[t]) && !IsClosed(told[t - 1])) frames.push_back(static_cast<int>(t));
  }
  return frames;
}

}  // namespace

std::vector<Arms> Varied(std::span<const Arms> told, SplitMix64& random) {
  std::vector<Arms> varied(told.begin(), told.end());
  if (random.Uniform() < kUnchanged) return varied;
  const auto frames = static_cast<int>(told.size());
  const std::vector<int> closings = Closings(told);
  const int closes = closings.empty() ? static_cast<int>(random.Below(static_cast<std::uint64_t>(frames)))
                                      : closings[random.Below(closings.size())];
  int opens = closes + 1;
  while (opens < frames && (closings.empty() || IsClosed(told[static_cast<std::size_t>(opens)]))) ++opens;
  const Eigen::Vector3d at_closing_m = Away_m(random), at_opening_m = Away_m(random);
  const double turn_rad = random.Normal() * kTurn_deg * std::numbers::pi / 180;
  const double turned = random.Uniform() < kTurned ? turn_rad : 0;
  const int closes_later = OtherTime(random), opens_later = OtherTime(random);
  const int lifted = std::min(closes + kLift, opens), middle = (closes + opens) / 2;
  for (int t = 1; t < frames; ++t) {
    ArmState& hand = varied[static_cast<std::size_t>(t)].back();
    const double there = Risen(t, std::max(0, closes - kReach), closes), onwards = Risen(t, lifted, opens);
    const Eigen::Vector3d away_m = there * ((1 - onwards) * at_closing_m + onwards * at_opening_m);
    hand.base_from_gripper.translation() += away_m;
    hand.base_from_gripper.linear() =
        Eigen::AngleAxisd(there * turned, Eigen::Vector3d::UnitZ()).toRotationMatrix() * hand.base_from_gripper.linear();
    const int as_at = std::clamp(t - (t < middle ? closes_later : opens_later), 0, frames - 1);
    hand.closure = told[static_cast<std::size_t>(as_at)].back().closure;
  }
  return varied;
}

}  // namespace evac
