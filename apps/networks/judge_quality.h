#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/networks/judge_training.h"
#include "judges/classifier_judge.h"

/// How good a classifier is: on clips that nothing was learned from.
namespace evac {

/// How clips are shown to the classifier when it is measured.
struct JudgeLook {
  bool masks_object = false;  ///< a grey disc of `mask_radius` of the picture's height lies over the object
  bool first_view_only = false;
  double mask_radius = 0.2;
  bool reconstructed = false;  ///< the clips are shown as their codec gives them back
  double longer = 1;           ///< as RowsOf has it
};

/// The network's logits of success, in the order of the clips.
/// @param on_clip  called after each, where it is something
std::vector<double> Logits(const ClassifierNet& net, const JudgeClipSource& source, const JudgeClips& clips,
                           const JudgeLook& look, const std::function<void()>& on_clip = {});

/// As the card's temperature has it.
double CalibratedProbability(double logit, const ClassifierCard& card);

/// Mean logarithmic loss of uncalibrated logits.
double LogLoss(const std::vector<double>& logits, const JudgeClips& clips);

/// Temperature (Guo et al. 2017) that makes the likelihood of the outcomes largest, and the threshold at which as large a
/// share of failures is called successes as of successes failures, or comes closest to that; of several the one next to
/// .5. Kappa is nearly the same over a wide range of thresholds, so its maximum is chance; where the two errors balance, a
/// policy that succeeds half of the time is told to.
/// @param clips  of both outcomes
ClassifierCard Calibrate(const std::vector<double>& logits, const JudgeClips& clips, double unsure);

/// Each a number, or not a number where it is undefined.
struct MeasuredJudge {
  double auroc = 0, kappa = 0, ece = 0;
  double cannot_tell = 0;  ///< share near the threshold; kappa counts those as their nearer side
  std::size_t clips = 0;
  std::string Line() const;
};
MeasuredJudge Measure(const std::vector<double>& logits, const JudgeClips& clips, const ClassifierCard& card);

/// "near_miss 3/41, pretended_grasp 0/28": of failures, by what became of them, how many were taken for successes.
std::string MistakesByFate(const std::vector<double>& logits, const JudgeClips& clips, const ClassifierCard& card);

}  // namespace evac
