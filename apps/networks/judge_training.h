#pragma once

#include <array>
#include <optional>
#include <vector>

#include "apps/networks/judge_clips.h"
#include "apps/networks/picture_changes.h"
#include "judges/classifier_net.h"
#include "worldmodel/train/settings.h"

/// How the classifier judge is trained: on clips with a known outcome.
namespace evac {

struct JudgeTrainingOptions {
  train::JobOptions job;      ///< of it the trainer's alone: a classifier is trained in floats
  std::int64_t batch = 32;    ///< clips
  double calibration = 0.15;  ///< share of the training split's initial states that only calibrates
  double drop_view = 0.5;     ///< share of clips of which the first view alone is shown
  double jitter = 0.3;        ///< pictures between first and last move by up to this part of their distance
  std::int64_t looks = 1;     ///< places that each view looks at in each picture; the first is trained to be the object
  double longest = 1;         ///< clips are seen as up to so many times as long, as if they had stood still at the end
  double object_weight = 1;   ///< of looking where the object is, beside the verdict
  double reconstructed_share = 0.5;  ///< share of clips seen as a codec gives them back; without one, none
  std::int64_t shift_px = 0;         ///< each view's pictures are moved by up to this each way; the edge is repeated
  double mirror_share = 0;           ///< of clips that are seen mirrored, left for right, in every view
  double unsure = 0.1;               ///< what the card says: closer to the threshold is `cannot tell`
  PictureChanges changes;
};
train::Settings SettingsOf(JudgeTrainingOptions& options);

/// @throws InvalidInput, TensorError naming an option that is out of range: all but the trainer's
void CheckJudgeOptions(const JudgeTrainingOptions& options);

/// What a clip shows, moved: the same in all its pictures, so that what happens in it stays the same.
struct SeenClip {
  at::Tensor pictures;  ///< [V, T, H, W, 3] bytes
  at::Tensor objects;   ///< [V, T, 2] pixels: x, y
};
/// @param shift_px  per view: right, down
SeenClip Moved(const SeenClip& clip, const std::vector<std::array<std::int64_t, 2>>& shift_px, bool is_mirrored);

/// @param to  what they are for: "learn from"
/// @throws InvalidInput unless there is a success and a failure among them
void RequireBothOutcomes(const JudgeClips& clips, const char* to);

/// Clips to learn from, by initial state: most of them to learn from, the rest to calibrate with.
struct JudgeSplit {
  JudgeClips fit, calibration;
};
/// @param clips  of them those that are there again (PackedClip::is_again) calibrate no second time
/// @throws InvalidInput if either part has outcomes of one kind alone.
JudgeSplit SplitForJudge(const JudgeClips& clips, const JudgeTrainingOptions& options);

/// The rows that a classifier sees, evenly spaced.
/// @param longer  at least 1: had the clip stood still at the end until it was so many times as long
std::vector<std::int64_t> RowsOf(const PackedClip& clip, double longer = 1);
/// How much longer than they are clips are when it is measured what the training for longer ones was worth.
double MiddleLength(const JudgeTrainingOptions& options);
/// Bytes of clips [B, V, T, H, W, 3] as the network takes them, all views present.
ClassifierClips ForNetwork(const at::Tensor& bytes, const JudgeClips& clips);

class JudgeTraining {
 public:
  /// @param source, fit  outlive this; fit are clips of the source
  /// @throws InvalidInput, TensorError as CheckJudgeOptions
  JudgeTraining(const JudgeClipSource& source, const JudgeClips& fit, const JudgeTrainingOptions& options);
  at::Tensor Loss(const ClassifierNet& net, const train::StepPlace& place) const;

 private:
  struct Batch {
    ClassifierClips clips;
    at::Tensor success;  ///< [B] 1, 0
    at::Tensor object;   ///< [B, V, T, 2] in parts of the picture
    at::Tensor visible;  ///< [B, V, T] 1 where the object's middle is known, in the picture, and the view present
  };
  Batch Draw(const train::StepPlace& place) const;
  /// Right and down, of each view.
  std::vector<std::array<std::int64_t, 2>> DrawShifts(train::Dice& dice, std::int64_t views) const;

  const JudgeClipSource& source_;
  const JudgeClips& fit_;
  JudgeTrainingOptions options_;
};

}  // namespace evac
