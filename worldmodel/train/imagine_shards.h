#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/train/shards.h"

/// Recordings as a world model imagines them: told what was told, from the first picture on. What happened in reality is
/// known of them, so they say how far a model's pictures may be believed, and teach a judge to read those pictures.
namespace evac::train {

struct ImagineOptions {
  std::int64_t steps = 2;  ///< of DPM-Solver++(2M)
  std::int64_t batch = 8;  ///< clips at once; what is imagined of one does not depend on the others
  std::uint64_t seed = 0;
};

/// @param shards  with latents open, whole pictures or crops
/// @param clips   of them, each of at least one picture and one chunk
/// @returns per clip [frames, V, z, h, w], float: the first picture's latents as they are, the others imagined chunk by chunk,
///   remembering what rollouts do (RolloutMemory), and shown nothing else that was recorded. Where frames are left over
///   behind the last whole chunk, the last chunk begins earlier.
/// @throws TensorError naming a clip's shard if it is too short
std::vector<Tensor> ImagineClips(const nn::EvacModel& model, const ShardSet& shards, const std::vector<Clip>& clips,
                                 const ImagineOptions& options);

/// Writes a shard's latents anew into another folder, where `shard` is known by the same name: those of clips that are
/// long enough imagined, the others' as they are. Maps' latents are copied. Whole or not at all.
/// @param index  of the shard in the set
/// @param products  as EncodeOptions has it, and who imagined
/// @throws TensorError naming shard and clip if what is imagined is not finite as halves; nothing is written then
void WriteImaginedLatents(const nn::EvacModel& model, const ShardSet& shards, std::size_t index,
                          const std::filesystem::path& folder, const std::string& products,
                          const ImagineOptions& options);

}  // namespace evac::train
