#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/networks/judge_clips.h"

/// Clips of runs that somebody has judged: people, an imported table, the oracle. What a lab has of its own tasks.
namespace evac {

struct LabelledRuns {
  std::vector<std::filesystem::path> runs;
  std::string truth = "oracle";         ///< whose current verdicts are learned from: success and failure, nothing else
  std::vector<std::string> worlds = {};  ///< of which worlds; empty: all
  int height_px = 64, width_px = 96;     ///< of a picture as the judge will see it, multiples of 8
  double holdout = 0.25;                 ///< share of initial states that are kept apart to measure with
  std::int64_t least = 20;               ///< labels of each kind that a task must have to learn from
  std::uint64_t seed = 0;                ///< of the split
};

/// The same initial state is on one side only, whatever run, world or policy its clips are from.
struct LabelledClips {
  std::unique_ptr<const JudgeClipSource> learn, holdout;
};

/// Reads the labelled clips, each as 24 pictures evenly spaced in time, into memory (a clip of two views of 64x96: 0.9
/// MB).
/// @param say  is told of clips that cannot be read and are left out, and of a task whose instruction is another in
///   another run
/// @throws InvalidInput if a run is none; if no run has a world that is named; if nobody of that name has judged; if
///   tasks have other cameras; if a task has too few labels of one kind, or what is kept to measure with has none of
///   one: it says how many there are.
LabelledClips ReadLabelledClips(const LabelledRuns& options, const std::function<void(const std::string&)>& say);

}  // namespace evac
