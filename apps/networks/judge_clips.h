#pragma once

#include <string>
#include <vector>

#include "apps/networks/packed_clips.h"
#include "core/error.h"

namespace evac {

using JudgeClips = std::vector<PackedClip>;

/// Clips that a classifier judge learns from, and their pictures, wherever they lie: shards (judge_shard_clips.h) or
/// the videos of runs (judge_run_clips.h). A clip's rows are `first` … `first + frames - 1`.
class JudgeClipSource {
 public:
  virtual ~JudgeClipSource() = default;

  JudgeClips clips;
  std::vector<std::string> tasks, cameras;
  int height_px = 0, width_px = 0;  ///< of a picture
  std::string recipe;               ///< what the clips are, in few letters: trainings on others are told apart by it

  /// [V, T, H, W, 3] bytes. @param rows  ascending
  virtual at::Tensor Pictures(const PackedClip& clip, const std::vector<std::int64_t>& rows) const = 0;
  /// [V, T, 2] pixels: the middle of the task's object; not a number where nobody knows.
  virtual at::Tensor Objects(const PackedClip& clip, const std::vector<std::int64_t>& rows) const = 0;
  /// Whether a clip has as many rows as its recording has frames: then it is known how long the longest was.
  virtual bool KnowsLengths() const { return true; }
  /// Whether `Objects` knows any.
  virtual bool KnowsObjects() const { return true; }
  /// SHA-256 of the codec that `Reconstructed` shows; empty: there is none.
  virtual std::string Codec() const { return ""; }
  /// What it made of these clips, in few letters, as `recipe` says what the clips are.
  virtual std::string LatentsIdentity() const { return Codec(); }
  /// `Pictures` as the codec gives them back.
  virtual at::Tensor Reconstructed(const PackedClip&, const std::vector<std::int64_t>&) const {
    throw InternalError("these clips have no codec");
  }
  /// What one who judges must know of a clip that was learned from, so that it is not judged by what learned it: the
  /// first 12 digits of its SHA-256. Empty where nobody can meet it.
  virtual std::string Mark(const PackedClip&) const { return ""; }
};

}  // namespace evac
