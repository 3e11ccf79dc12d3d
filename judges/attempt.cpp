#include "judges/attempt.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "core/error.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

constexpr double kHolding_n = 0.5;    // of each finger
constexpr double kTouching_n = 0.02;  // of any
constexpr double kHeld_s = 0.3;       // both fingers, to count as a grasp
constexpr double kLifted_m = 0.03;    // above where it was at first, while held
constexpr double kFell_m = 0.06;      // lower at the end than where it was let go
constexpr double kMoved_m = 0.015;
constexpr double kTipped_deg = 25;
constexpr double kLow_m = 0.20;  // of the gripper: where there are things to take
constexpr double kClosed = 0.9, kOpen = 0.5;
constexpr double kNearMiss_m = 0.04, kEmpty_m = 0.12, kCame_m = 0.05;
constexpr double kAround_s = 0.4;  // before and after a moment that matters

struct Forces {
  double left_n = 0, right_n = 0, other_n = 0;  ///< of the two fingers, and of the rest of the arm

  bool BothHold() const { return left_n > kHolding_n && right_n > kHolding_n; }
  bool Touch() const { return left_n + right_n + other_n > kTouching_n; }
};

bool IsArm(const std::string& body) {
  return body == "hand" || body == "arm_base" || body.starts_with("link") || body.starts_with("finger_");
}

const Eigen::Isometry3d& PoseOf(const std::string& body, const PrivilegedFrame& frame) {
  for (const PrivilegedFrame::Body& found : frame.bodies) {
    if (found.name == body) return found.base_from_body;
  }
  throw InvalidInput("the privileged track has no body '{}'", body);
}

Forces ForcesOn(const std::string& body, const PrivilegedFrame& frame) {
  Forces forces;
  for (const PrivilegedFrame::Contact& contact : frame.contacts) {
    if (contact.a != body && contact.b != body) continue;
    const std::string& other = contact.a == body ? contact.b : contact.a;
    if (!IsArm(other)) continue;
    (other == "finger_left"    ? forces.left_n
     : other == "finger_right" ? forces.right_n
                               : forces.other_n) += contact.force_n;
  }
  return forces;
}

/// Everything about the object and the hand, frame by frame.
class Story {
 public:
  explicit Story(const Attempt& attempt)
      : attempt_(attempt), held_frames_(static_cast<std::size_t>(std::lround(kHeld_s / attempt.task.period_s))) {
    for (const PrivilegedFrame& frame : attempt.track) {
      forces_.push_back(ForcesOn(attempt.object, frame));
      base_from_object_.push_back(PoseOf(attempt.object, frame));
      gripper_m_.push_back(PoseOf("gripper", frame).translation());
    }
    FindLowClosing();
  }

  std::size_t frames() const { return forces_.size(); }
  const std::vector<Forces>& forces() const { return forces_; }
  std::optional<std::size_t> closed_low() const { return closed_low_; }

  bool IsTouched() const {
    return std::any_of(forces_.begin(), forces_.end(), [](auto& f) { return f.Touch(); });
  }
  bool IsHeldByBoth() const {
    return LongestRun([&](std::size_t k) { return forces_[k].BothHold(); }) >= held_frames_;
  }
  bool IsLifted() const {
    return LongestRun([&](std::size_t k) { return forces_[k].BothHold() && Height(k) - Height(0) > kLifted_m; }) >= 2;
  }
  bool IsHeldAtEnd() const { return forces_.back().BothHold(); }

  /// How it came down after the last frame at which both fingers held it. A hand that is told to open lets go within
  /// the period: what it was told a moment later says whether it meant to.
  bool Fell() const {
    std::size_t last = 0;
    for (std::size_t k = 0; k < frames(); ++k) last = forces_[k].BothHold() ? k : last;
    const double told_later = attempt_.told[std::min(last + 2, frames() - 1)].back().closure;
    return Height(last) - Height(frames() - 1) > kFell_m || told_later > kClosed;
  }

  bool IsMoved() const {
    const Eigen::Isometry3d &first = base_from_object_.front(), &last = base_from_object_.back();
    const double tip_rad = std::acos(std::clamp(first.linear().col(2).dot(last.linear().col(2)), -1.0, 1.0));
    return (last.translation() - first.translation()).norm() > kMoved_m ||
           tip_rad * 180 / std::numbers::pi > kTipped_deg;
  }

  /// Horizontal distance of the hand from the object.
  double Distance(std::size_t k) const { return (gripper_m_[k] - base_from_object_[k].translation()).head<2>().norm(); }
  bool CameNear() const {
    for (std::size_t k = 0; k < frames(); ++k) {
      if (gripper_m_[k].z() < kLow_m && Distance(k) < kCame_m) return true;
    }
    return false;
  }

  /// Whether both fingers held a thing that is not the object; the table is no thing.
  bool HeldAnother() const {
    std::set<std::string> others;
    for (const PrivilegedFrame& frame : attempt_.track) {
      for (const PrivilegedFrame::Contact& contact : frame.contacts) {
        if (IsArm(contact.a)) others.insert(contact.b);
        if (IsArm(contact.b)) others.insert(contact.a);
      }
    }
    return std::any_of(others.begin(), others.end(), [&](const std::string& body) {
      if (body == attempt_.object || body == "table" || body == "floor" || IsArm(body)) return false;
      const auto holds = [&](std::size_t k) { return ForcesOn(body, attempt_.track[k]).BothHold(); };
      return LongestRun(holds) >= held_frames_;
    });
  }

 private:
  double Height(std::size_t k) const { return base_from_object_[k].translation().z(); }

  template <typename Holds>
  std::size_t LongestRun(const Holds& holds) const {
    std::size_t run = 0, longest = 0;
    for (std::size_t k = 0; k < frames(); ++k) {
      run = holds(k) ? run + 1 : 0;
      longest = std::max(longest, run);
    }
    return longest;
  }

  /// Of all times at which the hand, open before, is told to close down there: the one nearest to the object.
  void FindLowClosing() {
    bool was_open = true;
    for (std::size_t k = 0; k < frames(); ++k) {
      const double told = attempt_.told[k].back().closure;
      if (told < kOpen) was_open = true;
      if (!was_open || told < kClosed) continue;
      was_open = false;
      if (gripper_m_[k].z() < kLow_m && (!closed_low_ || Distance(k) < Distance(*closed_low_))) closed_low_ = k;
    }
  }

  const Attempt& attempt_;
  std::size_t held_frames_;
  std::vector<Forces> forces_;
  std::vector<Eigen::Isometry3d> base_from_object_;
  std::vector<Eigen::Vector3d> gripper_m_;
  std::optional<std::size_t> closed_low_;
};

Fate FateOfUnheld(const Story& story) {
  if (story.closed_low()) {
    const std::size_t at = *story.closed_low();
    const double distance_m = story.Distance(at);
    if (distance_m < kNearMiss_m || story.forces()[at].Touch()) return Fate::kNearMiss;
    if (story.IsTouched() && story.IsMoved()) return Fate::kPush;
    return distance_m < kEmpty_m ? Fate::kEmptyGrasp : Fate::kPretendedGrasp;
  }
  if (story.IsTouched() && story.IsMoved()) return Fate::kPush;
  return story.IsTouched() || story.CameNear() ? Fate::kNoGrasp : Fate::kUntouched;
}

Fate FateOf(const Story& story, bool success) {
  if (success) return Fate::kSuccess;
  if (story.IsLifted()) {
    if (story.IsHeldAtEnd()) return Fate::kStillHeld;
    return story.Fell() ? Fate::kDrop : Fate::kMisplaced;
  }
  if (story.IsHeldByBoth()) return Fate::kSlip;
  return story.HeldAnother() ? Fate::kWrongObject : FateOfUnheld(story);
}

std::vector<std::uint8_t> Contact(const Story& story, double period_s) {
  const auto around = static_cast<std::size_t>(std::lround(kAround_s / period_s));
  std::vector<std::uint8_t> contact(story.frames(), 0);
  const auto mark = [&](std::size_t at) {
    const std::size_t end = std::min(at + around + 1, story.frames());
    std::fill(contact.begin() + static_cast<std::ptrdiff_t>(at - std::min(at, around)),
              contact.begin() + static_cast<std::ptrdiff_t>(end), std::uint8_t{1});
  };
  bool touched = false;
  for (std::size_t k = 1; k < story.frames(); ++k) {
    const Forces &before = story.forces()[k - 1], &now = story.forces()[k];
    if (!touched && now.Touch()) mark(k);
    touched = touched || now.Touch();
    if (before.BothHold() != now.BothHold()) mark(k);
  }
  if (story.closed_low()) mark(*story.closed_low());
  return contact;
}

}  // namespace

const char* Name(Fate fate) {
  static constexpr const char* kNames[] = {"success",      "drop",      "misplaced",   "still_held",      "slip",
                                           "wrong_object", "near_miss", "empty_grasp", "pretended_grasp", "push",
                                           "no_grasp",     "untouched"};
  static_assert(std::size(kNames) == kFates);
  return kNames[static_cast<int>(fate)];
}

WhatHappened Look(const Attempt& attempt) {
  if (attempt.track.empty() || attempt.told.size() != attempt.track.size()) {
    throw InternalError("{} frames and {} targets, wanted the same, at least one", attempt.track.size(),
                        attempt.told.size());
  }
  const Verdict verdict = RateTrack(attempt.task, attempt.track);
  if (verdict.label == Label::kInvalid) throw InvalidInput("task {}: {}", attempt.task.id, verdict.reason);
  const Story story(attempt);
  return {FateOf(story, verdict.label == Label::kSuccess), verdict.reason, Contact(story, attempt.task.period_s)};
}

}  // namespace evac
