#include "judges/oracle_judge.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "judges/rubric.h"

namespace evac {
namespace {

/// Fills in label, stages and reason.
void JudgeTrack(const Rubric& rubric, const TrackView& track, Verdict& verdict) {
  std::string story;
  std::size_t from = 0;
  bool all = true;
  for (const Stage& stage : rubric.stages) {
    const StageOutcome outcome = all ? Follow(stage, track, from) : StageOutcome{};
    verdict.stages[stage.name] = outcome.reached;
    if (!outcome.reached && all) verdict.reason = outcome.why_not;
    all = all && outcome.reached;
    from = outcome.at_frame;
    if (all)
      story += fmt::format("{}{} at {:.1f} s", story.empty() ? "" : ", ", stage.name,
                           static_cast<double>(from) * track.period_s);
  }
  verdict.label = all ? Label::kSuccess : Label::kFailure;
  verdict.reason =
      all ? "every stage was reached: " + story : verdict.reason + (story.empty() ? "" : " (before it: " + story + ")");
}

std::optional<std::string> WhatIsWrong(const Condition& condition) {
  const MeasureKind* kind = FindMeasure(condition.kind);
  if (!kind) return fmt::format("unknown kind of condition '{}'", condition.kind);
  if (condition.a.empty()) return fmt::format("{} needs a body a", condition.kind);
  if (kind->needs_b && condition.b.empty()) return fmt::format("{} needs a body b", condition.kind);
  if (!kind->needs_b && !condition.b.empty())
    return fmt::format("{} is about one body, found b: '{}'", condition.kind, condition.b);
  if (!condition.above && !condition.below) return fmt::format("{} has neither above nor below", condition.kind);
  if ((condition.above && !std::isfinite(*condition.above)) || (condition.below && !std::isfinite(*condition.below))) {
    return fmt::format("{} has a bound that is not finite", condition.kind);
  }
  if (condition.above && condition.below && *condition.above >= *condition.below) {
    return fmt::format("{} can never hold: above {} and below {}", condition.kind, *condition.above, *condition.below);
  }
  return std::nullopt;
}

bool HasBody(const PrivilegedFrame& frame, const std::string& body) {
  return std::any_of(frame.bodies.begin(), frame.bodies.end(), [&](const auto& known) { return known.name == body; });
}

}  // namespace

std::optional<std::string> WhatIsWrong(const Rubric& rubric) {
  std::set<std::string> names;
  for (const Stage& stage : rubric.stages) {
    if (stage.name.empty()) return "a stage has no name";
    if (!names.insert(stage.name).second) return fmt::format("stage {} is there twice", stage.name);
    if (stage.all_of.empty()) return fmt::format("stage {} has no conditions", stage.name);
    if (!(stage.hold_s >= 0 && std::isfinite(stage.hold_s)))
      return fmt::format("stage {}: hold_s is {}, wanted 0 or more", stage.name, stage.hold_s);
    for (const Condition& condition : stage.all_of) {
      if (const auto wrong = WhatIsWrong(condition)) return fmt::format("stage {}: {}", stage.name, *wrong);
    }
  }
  return std::nullopt;
}

std::optional<std::string> WhatIsWrong(const Rubric& rubric, const PrivilegedFrame& frame) {
  if (auto wrong = WhatIsWrong(rubric)) return wrong;
  for (const Stage& stage : rubric.stages) {
    for (const Condition& condition : stage.all_of) {
      for (const std::string& body : {condition.a, condition.b}) {
        if (!body.empty() && !HasBody(frame, body)) {
          return fmt::format("stage {}: {} names the body '{}', which the world does not have", stage.name,
                             condition.kind, body);
        }
      }
    }
  }
  return std::nullopt;
}

Verdict RateTrack(const Task& task, const PrivilegedTrack& track) {
  Verdict verdict;
  verdict.judge = "oracle";
  verdict.rubric_version = task.rubric.version;
  if (auto wrong = WhatIsWrong(task.rubric, track.front())) {
    verdict.label = Label::kInvalid;
    verdict.reason = "rubric: " + *wrong;
  } else {
    JudgeTrack(task.rubric, {track, task.period_s}, verdict);
  }
  return verdict;
}

Verdict OracleJudge::Rate(const Task& task, const Episode& episode) {
  Verdict verdict;
  verdict.episode_id = episode.key.Id();
  verdict.judge = Name();
  verdict.rubric_version = task.rubric.version;
  const auto say = [&](Label label, std::string reason) {
    verdict.label = label;
    verdict.reason = std::move(reason);
    return verdict;
  };
  if (IsFailure(episode.stop))
    return say(Label::kInvalid, fmt::format("a failed episode ({}) is not judged", evac::Name(episode.stop)));
  if (task.rubric.stages.empty()) return say(Label::kCannotTell, "the task's rubric has no stages");
  const PrivilegedTrack track = store_.LoadPrivileged(verdict.episode_id);
  if (track.empty()) return say(Label::kCannotTell, "the world has no physics: there is no privileged track");
  Verdict rated = RateTrack(task, track);
  rated.episode_id = verdict.episode_id;
  return rated;
}

}  // namespace evac
