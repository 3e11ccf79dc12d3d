#include "judges/rubric.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "core/error.h"

namespace evac {
namespace {

constexpr MeasureKind kKinds[] = {{"distance", "m", true},      {"horizontal_distance", "m", true},
                                  {"height", "m", false},       {"height_gain", "m", false},
                                  {"displacement", "m", false}, {"contact", "N", true},
                                  {"tilt", "deg", false},       {"speed", "m/s", false}};

const Eigen::Isometry3d& PoseOf(const std::string& body, const PrivilegedFrame& frame) {
  for (const PrivilegedFrame::Body& found : frame.bodies) {
    if (found.name == body) return found.base_from_body;
  }
  throw InvalidInput("the privileged track has no body '{}'", body);
}

Eigen::Vector3d At(const std::string& body, const PrivilegedFrame& frame) { return PoseOf(body, frame).translation(); }

double Force(const Condition& condition, const PrivilegedFrame& frame) {
  const auto& [first, second] = std::minmax(condition.a, condition.b);
  double force_n = 0;
  for (const PrivilegedFrame::Contact& contact : frame.contacts) {
    if (contact.a == first && contact.b == second) force_n += contact.force_n;
  }
  return force_n;
}

double Tilt(const Eigen::Isometry3d& pose) {
  return std::acos(std::clamp(pose.linear()(2, 2), -1.0, 1.0)) * 180 / std::numbers::pi;
}

/// How a stage's conditions stand at one frame.
struct Standing {
  std::size_t frame = 0;
  int unmet = 0;
  double shortfall = 0;

  bool NearerThan(const Standing& other) const {
    return std::tie(unmet, shortfall) < std::tie(other.unmet, other.shortfall);
  }
};

Standing StandingAt(const Stage& stage, const TrackView& track, std::size_t frame) {
  Standing standing{frame, 0, 0};
  for (const Condition& condition : stage.all_of) {
    const double value = Measure(condition, track, frame);
    standing.unmet += Holds(condition, value) ? 0 : 1;
    standing.shortfall += Shortfall(condition, value);
  }
  return standing;
}

/// The conditions that do not hold at a frame, with their values.
std::string Unmet(const Stage& stage, const TrackView& track, std::size_t frame) {
  std::string sentence;
  for (const Condition& condition : stage.all_of) {
    const double value = Measure(condition, track, frame);
    if (Holds(condition, value)) continue;
    sentence += (sentence.empty() ? "" : "; ") + Describe(condition, value);
  }
  return sentence;
}

/// Frames after the first one until `hold_s` has passed.
std::size_t HoldFrames(const Stage& stage, double period_s) {
  constexpr double kRounding = 1e-6;
  return static_cast<std::size_t>(std::max(0.0, std::ceil(stage.hold_s / period_s - kRounding)));
}

}  // namespace

const MeasureKind* FindMeasure(const std::string& kind) {
  const auto found =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const MeasureKind& known) { return known.name == kind; });
  return found == std::end(kKinds) ? nullptr : found;
}

double Measure(const Condition& condition, const TrackView& track, std::size_t frame) {
  const std::string& kind = condition.kind;
  const PrivilegedFrame& now = track.frames.at(frame);
  const Eigen::Vector3d a_m = At(condition.a, now);
  if (kind == "distance") return (a_m - At(condition.b, now)).norm();
  if (kind == "horizontal_distance") return (a_m - At(condition.b, now)).head<2>().norm();
  if (kind == "height") return a_m.z();
  if (kind == "height_gain") return a_m.z() - At(condition.a, track.frames.front()).z();
  if (kind == "displacement") return (a_m - At(condition.a, track.frames.front())).head<2>().norm();
  if (kind == "contact") return Force(condition, now);
  if (kind == "tilt") return Tilt(PoseOf(condition.a, now));
  if (kind == "speed") return frame == 0 ? 0 : (a_m - At(condition.a, track.frames[frame - 1])).norm() / track.period_s;
  throw InvalidInput("unknown kind of condition '{}'", kind);
}

bool Holds(const Condition& condition, double value) {
  return !std::isnan(value) && (!condition.above || value > *condition.above) &&
         (!condition.below || value < *condition.below);
}

double Shortfall(const Condition& condition, double value) {
  if (Holds(condition, value)) return 0;
  if (std::isnan(value)) return std::numeric_limits<double>::infinity();
  const double bound = condition.above && value <= *condition.above ? *condition.above : *condition.below;
  return std::abs(value - bound) / (bound == 0 ? 1 : std::abs(bound));
}

std::string Describe(const Condition& condition, double value) {
  const MeasureKind* kind = FindMeasure(condition.kind);
  std::string wanted;
  if (condition.above) wanted = fmt::format("above {}", *condition.above);
  if (condition.below) wanted += fmt::format("{}below {}", wanted.empty() ? "" : " and ", *condition.below);
  return fmt::format("{} of {}{} was {} {}, wanted {}", condition.kind, condition.a,
                     kind->needs_b ? " and " + condition.b : "", std::round(value * 1000) / 1000, kind->unit, wanted);
}

StageOutcome Follow(const Stage& stage, const TrackView& track, std::size_t from) {
  const std::size_t last = track.frames.size() - 1, wanted = HoldFrames(stage, track.period_s);
  std::size_t run = 0, longest = 0;  // frames in a row at which all holds
  Standing nearest = StandingAt(stage, track, from);
  for (std::size_t frame = from; frame <= last; ++frame) {
    const Standing now = StandingAt(stage, track, frame);
    if (now.NearerThan(nearest)) nearest = now;
    run = now.unmet == 0 ? run + 1 : 0;
    longest = std::max(longest, run);
    if (run <= wanted) continue;
    if (!stage.at_end || StandingAt(stage, track, last).unmet == 0) return {true, frame, ""};
    return {false, 0,
            fmt::format("stage {} held at {:.1f} s, but not at the end: {}", stage.name,
                        static_cast<double>(frame) * track.period_s, Unmet(stage, track, last))};
  }
  if (longest > 0) {
    return {false, 0,
            fmt::format("stage {} held for {:.1f} s at most, wanted {:.1f} s", stage.name,
                        static_cast<double>(longest - 1) * track.period_s, stage.hold_s)};
  }
  return {false, 0,
          fmt::format("stage {} was not reached; nearest at {:.1f} s: {}", stage.name,
                      static_cast<double>(nearest.frame) * track.period_s, Unmet(stage, track, nearest.frame))};
}

}  // namespace evac
