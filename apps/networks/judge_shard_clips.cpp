#include "apps/networks/judge_shard_clips.h"

namespace evac {
namespace {

at::Tensor Indices(const std::vector<std::int64_t>& rows) { return at::tensor(at::ArrayRef<std::int64_t>(rows)); }

}  // namespace

ShardClips::ShardClips(const train::ShardFolders& shards, train::Split split, const ShardCodec* codec)
    : set_(shards, split), codec_(codec) {
  tasks = set_.tasks;
  cameras = set_.cameras;
  height_px = static_cast<int>(set_.shards.height_px());
  width_px = static_cast<int>(set_.shards.width_px());
  recipe = set_.shards.metadata().at("recipe");
  for (const PackedClip& clip : set_.clips) {
    if (clip.outcome >= 0) clips.push_back(clip);
  }
  if (clips.empty())
    throw InvalidInput("{}: none of the {} clips says whether it was a success, wanted shards of what `evac collect` "
                       "recorded; a judge of clips that somebody rated is `evac judge train`'s",
                       set_.shards.FolderNames(), set_.clips.size());
  if (codec_) codec_->Open(set_.shards);
}

at::Tensor ShardClips::Pictures(const PackedClip& clip, const std::vector<std::int64_t>& rows) const {
  return ShardOf(clip).frames.index_select(0, Indices(rows)).transpose(0, 1);
}

at::Tensor ShardClips::Objects(const PackedClip& clip, const std::vector<std::int64_t>& rows) const {
  return ShardOf(clip).object_px.index_select(0, Indices(rows)).transpose(0, 1);
}

at::Tensor ShardClips::Reconstructed(const PackedClip& clip, const std::vector<std::int64_t>& rows) const {
  return codec_->Reconstructed(ShardOf(clip), rows);
}

}  // namespace evac
