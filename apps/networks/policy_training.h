#pragma once

#include <string>
#include <vector>

#include "apps/networks/packed_clips.h"
#include "apps/networks/picture_changes.h"
#include "apps/networks/shard_codec.h"
#include "core/types.h"
#include "policies/learned_net.h"
#include "worldmodel/train/settings.h"

/// How a policy learns by imitation: what the arms did in recordings that did not fail.
namespace evac {

struct PolicyOptions {
  train::JobOptions job;                      ///< of it the trainer's alone: a policy is trained in floats
  std::int64_t batch = 64;                    ///< moments
  std::string behaviours = "good,near_miss";  ///< of a collection's mix, those worth imitating; empty: all, and
                                              ///< recordings whose outcome nobody knows
  double contact_share = 0.5;                 ///< of moments whose chunk holds contact, beside those drawn from all
  double arm_noise_m = 0.004;                 ///< deviation of where the arm is said to be: it learns to come back
  double object_weight = 1;                   ///< of pointing at the object, beside the targets
  double reconstructed_share = 0.5;  ///< of moments that are shown as the codec gives them back, if there is one
  PictureChanges changes;
};
train::Settings SettingsOf(PolicyOptions& options);

/// One frame of a clip that is imitated, and the targets that followed it.
struct Moment {
  std::size_t clip = 0;  ///< of `PackedSet::clips`
  std::int64_t row = 0;  ///< of the clip, from 0
  bool is_reconstructed = false;
};

class PolicyTraining {
 public:
  /// @param set  outlives this
  /// @param codec  whose latents of `set` are open, or null; outlives this
  /// @throws InvalidInput if nothing in it is worth imitating, saying of a hold-out that it is one; for an option
  ///   out of range, as TensorError does.
  PolicyTraining(const PackedSet& set, const PolicyOptions& options, const ShardCodec* codec);

  at::Tensor Loss(const LearnedNet& net, const train::StepPlace& place) const;
  /// The same over moments evenly spread over all clips, nothing changed or drawn; without the object's part.
  double Measure(const LearnedNet& net, std::int64_t moments) const;
  std::size_t clips() const { return imitated_.size(); }

 private:
  struct Batch {
    LearnedInput input;
    at::Tensor targets;  ///< [B, kLearnedChunk, A, kArmNumbers]
    at::Tensor object;   ///< [B, V, 2] in parts of the picture
    at::Tensor visible;  ///< [B, V] 1 where the object's middle is known and in the picture
  };
  /// [V, H, W, 3] bytes, as it was seen or as the codec gives it back.
  at::Tensor Seen(const Moment& moment) const;
  Batch BatchOf(const std::vector<Moment>& moments) const;
  Moment Draw(train::Dice& dice) const;
  Arms ArmsAt(const PackedClip& clip, std::int64_t row) const;
  void PutMoment(const Moment& moment, std::int64_t b, Batch& batch) const;
  at::Tensor Distance(const LearnedOutput& output, const Batch& batch) const;

  const PackedSet& set_;
  PolicyOptions options_;
  const ShardCodec* codec_;
  std::vector<at::Tensor> actions_;  ///< of each shard, [F, 16]
  std::vector<std::string> arms_;
  std::vector<std::size_t> imitated_;  ///< clips
  std::vector<Moment> contacts_;       ///< moments whose chunk holds contact
};

/// Where a camera is at a row of a clip, base_from_camera: one that a gripper carries goes with where that gripper was
/// told to be, as the policy will know it when it acts, however late the shards' `c2w` follow (`lag_frames`).
Eigen::Isometry3d ToldCamera(const train::Shard& shard, std::int64_t clip_first, std::int64_t row, std::int64_t view,
                             Mount mount);
/// {right}, or {left, right}: whose arms the shards hold.
std::vector<std::string> ArmsOf(const PackedSet& set);
/// The views' cameras, on their mounts, as the card keeps them: of a clip that shows the whole picture.
/// @throws InvalidInput if there is none
std::vector<Camera> CamerasOf(const PackedSet& set);

}  // namespace evac
