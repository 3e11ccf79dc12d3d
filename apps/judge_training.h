#pragma once

#include <optional>
#include <vector>

#include "apps/judge_codec.h"
#include "apps/packed_clips.h"
#include "apps/picture_changes.h"
#include "judges/classifier_net.h"
#include "worldmodel/train/settings.h"

/// How the classifier judge is trained: on clips of a packing, whose outcome is the oracle's.
namespace evac {

struct JudgeOptions {
  train::JobOptions job;             ///< of it the trainer's alone: a classifier is trained in floats
  std::int64_t batch = 32;           ///< clips
  double calibration = 0.15;         ///< share of the training split's initial states that only calibrates
  double drop_view = 0.5;            ///< share of clips of which the first view alone is shown
  double jitter = 0.3;               ///< pictures between first and last move by up to this part of their distance
  double object_weight = 1;          ///< of looking where the object is, beside the verdict
  double reconstructed_share = 0.5;  ///< share of clips seen as a codec gives them back; without one, none
  double unsure = 0.1;               ///< what the card says: closer to the threshold is `cannot tell`
  PictureChanges changes;
};
train::Settings SettingsOf(JudgeOptions& options);

/// A clip with a known outcome, and how it is looked at.
using JudgeClips = std::vector<PackedClip>;

/// The training split by initial state: most of it to learn from, the rest to calibrate with. Unknown outcomes are left
/// out.
struct JudgeSplit {
  JudgeClips fit, calibration;
};
JudgeSplit SplitForJudge(const PackedSet& set, const JudgeOptions& options);
/// Those with a known outcome.
JudgeClips Labelled(const PackedSet& set);

/// [V, T, H, W, 3] bytes of a clip's eight pictures. @param rows  of the clip's shard, ascending
at::Tensor PicturesOf(const PackedSet& set, const PackedClip& clip, const std::vector<std::int64_t>& rows);
/// The rows that a classifier sees, evenly spaced.
std::vector<std::int64_t> RowsOf(const PackedClip& clip);
/// Bytes of clips [B, V, T, H, W, 3] as the network takes them, all views present.
ClassifierClips ForNetwork(const at::Tensor& bytes, const JudgeClips& clips);

class JudgeTraining {
 public:
  /// @param set, fit, codec  outlive this
  JudgeTraining(const PackedSet& set, const JudgeClips& fit, const JudgeOptions& options, const JudgeCodec* codec);
  at::Tensor Loss(const ClassifierNet& net, const train::StepPlace& place) const;

 private:
  struct Batch {
    ClassifierClips clips;
    at::Tensor success;  ///< [B] 1, 0
    at::Tensor object;   ///< [B, V, T, 2] in parts of the picture
    at::Tensor visible;  ///< [B, V, T] 1 where the object's middle is known, in the picture, and the view present
  };
  Batch Draw(const train::StepPlace& place) const;

  const PackedSet& set_;
  const JudgeClips& fit_;
  JudgeOptions options_;
  const JudgeCodec* codec_;
};

}  // namespace evac
