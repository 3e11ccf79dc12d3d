#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/store_study.h"

namespace evac {

struct ResolveOptions {
  std::string judge = "human";  ///< the name under which the labels stand in the runs' stores; no other judge's
  bool each_rater = false;      ///< every rater's vote as well, as "human:<study>:r3"
  bool mix_rubrics = false;     ///< labels of one task by different rubrics are one judge's
};

struct Resolved {
  std::int64_t written = 0;  ///< new verdicts in the runs' stores
  std::int64_t decided = 0, undecided = 0;
  std::int64_t unlabelled = 0;  ///< examples and practice clips of the study: of them no label is made
  std::vector<std::string> warnings;
};

/// The way back: labels by majority or by an adjudicator become verdicts of the runs they came from, where `evac judge
/// calibrate --against human`, `evac report --judge human` and everything else finds them. Clips that are not decided
/// are written as cannot_tell with the reason, never as failures. What is there already is not written again. Where a
/// run has a verdict of votes that count no more (their raters left, or undid them), cannot_tell takes its place.
/// Of two studies that give labels under one name to one episode the later one's holds, and a warning says so; their
/// reasons tell them apart by name and id, those of earlier versions by the name alone.
/// Stages are written where somebody told of them: a sheet does not, nor who saw a success and marked none.
/// @throws InvalidInput for a name of other judges, or if a run has moved, or holds another video than raters saw of an
/// episode that gets a verdict, or votes of another study of the same name under a rater's name (then nothing is
/// written), or a task was rated by several rubrics and they were not to be mixed, or the study is damaged
/// (StudyStore::RequireWhole).
Resolved ResolveStudy(const StudyStore& study, const ResolveOptions& options);

}  // namespace evac
