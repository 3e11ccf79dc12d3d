#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/store_study.h"
#include "judges/rating_clip.h"

namespace evac {

inline constexpr int kStudyHeight_px = 512;

struct StudyOptions {
  std::vector<std::filesystem::path> runs = {};  ///< one that is named twice, or by a link, is one
  std::string name = {};                         ///< empty: the folder's
  std::uint64_t seed = 1;
  int raters_per_clip = 3;
  std::optional<int> height_px = {};  ///< of the first view, 64 … 1080; nothing: kStudyHeight_px, of a study that is
                                      ///< there what it was begun with
  int states = 0;  ///< so many initial states per task of those that have a clip, drawn by the seed once for all runs,
                   ///< with all their clips; those that the study has are drawn first; 0: all
  std::string gold_from =
      {};                    ///< a judge of the runs whose verdicts are known to be right; empty: no gold, no practice
  int examples = 4;          ///< clips shown with their label before the session, if there is gold; rated by nobody
  int practice = 8;          ///< clips with feedback, if there is gold; their answers count nowhere. Both together are
                             ///< successes and failures in the proportion of what is known: it is the rest's too
  double gold_share = 0.06;  ///< of the clips, at least `min_gold`, at most a quarter
  int min_gold = 12;
  ClipRoundTrip round_trip = {};  ///< of clips from worlds that are not imagined; the same for all waves of a study
  std::string evac_version = {};
};

struct StudyMade {
  int clips = 0, gold = 0, practice = 0, examples = 0;
  std::string list_hash;
  std::vector<std::string> left_out;  ///< why episodes are not in it, a sentence each
  std::vector<std::string> warnings;  ///< by what raters can tell its clips from those that were there
};

/// Freezes the episodes of runs that have a video into a study: encodes every clip anew (rating_clip.h), gives it a
/// name that says nothing, and writes the list. A study that is there gets another wave with what it does not hold yet,
/// as high as the first and as long in bytes as what is there, or longer with a warning; views of a task that would be
/// wider than its clips are made smaller. A call that is broken off leaves no wave; the next one encodes what that one
/// had not come to, and leaves in clips/ what the study names alone.
/// @param progress  called after every clip with how many are done, of how many.
/// @throws InvalidInput if a run is not there, no episode has a video, an option is out of range, or earlier waves were
/// put through another codec, or through none, or are of another height than is asked for; or if a task's views do not
/// fit into the study's clips even 64 px high; or if an episode whose clip is in the study has another video by now, or
/// another process makes a wave of it; or if a task has no rubric (kNoRubric) or more than kMostStages stages, or a run
/// no row of an episode's task or world.
StudyMade MakeStudy(const std::filesystem::path& folder, const StudyOptions& options,
                    const std::function<void(std::size_t, std::size_t)>& progress);

/// What raters are told of a task, as it is stored and hashed.
StudyRubric RubricOf(const Task& task);

}  // namespace evac
