#pragma once

#include <string>
#include <vector>

#include "apps/networks/judge_clips.h"
#include "judges/classifier_judge.h"

/// What a judge says of clips whose outcome is known, as tables: what its threshold does, and which clips it takes wrongly.
namespace evac {

/// What the network says of clips that were shown to it in one way.
struct JudgedClips {
  std::string part;            ///< "calibration", "hold-out"
  std::string seen;            ///< "recorded"; "given back": by the codec, imagined ones among them
  const JudgeClips* clips;     ///< outlive this
  std::vector<double> logits;  ///< of success, uncalibrated, in the order of the clips
};

/// A row per clip: part,seen,task,recording,state,behaviour,fate,outcome,probability,verdict. The recording is its number
/// in the packing, or of a run's clip its `episode`. Outcome 1 or 0; the probability calibrated, the verdict with the
/// card's threshold and its margin.
/// @param tasks  names by a clip's number of its task
std::string JudgedCsv(const std::vector<JudgedClips>& judged, const ClassifierCard& card,
                      const std::vector<std::string>& tasks);

/// A row per part, way of seeing and threshold of .05, .1 … .95: part,seen,threshold,failures,called_successes,successes,
/// called_failures,agreement; every clip is called one or the other.
std::string ThresholdsCsv(const std::vector<JudgedClips>& judged, const ClassifierCard& card);

}  // namespace evac
