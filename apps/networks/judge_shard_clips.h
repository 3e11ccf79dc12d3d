#pragma once

#include "apps/networks/judge_clips.h"
#include "apps/networks/shard_codec.h"

namespace evac {

/// One split of some packings, all clips whose outcome is known.
class ShardClips final : public JudgeClipSource {
 public:
  /// @param codec  whose latents lie beside the shards, or null; outlives this
  /// @throws as PackedSet and ShardCodec::Open; InvalidInput if no clip's outcome is known
  ShardClips(const train::ShardFolders& shards, train::Split split, const ShardCodec* codec);

  at::Tensor Pictures(const PackedClip& clip, const std::vector<std::int64_t>& rows) const override;
  at::Tensor Objects(const PackedClip& clip, const std::vector<std::int64_t>& rows) const override;
  std::string Codec() const override { return codec_ ? set_.shards.codec() : ""; }
  std::string LatentsIdentity() const override { return set_.shards.LatentsIdentity(); }
  at::Tensor Reconstructed(const PackedClip& clip, const std::vector<std::int64_t>& rows) const override;

 private:
  const train::Shard& ShardOf(const PackedClip& clip) const { return set_.shards.shards()[clip.shard]; }

  PackedSet set_;
  const ShardCodec* codec_;
};

}  // namespace evac
