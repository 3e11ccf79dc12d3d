#pragma once

#include "worldmodel/train/settings.h"
#include "worldmodel/train/shards.h"

namespace evac::train {

/// Where a training reads and writes, and who hears of it.
struct JobPlace {
  ShardFolders shards;  ///< drawn from as often as they are named; their hold-out is measured once (EachOnce)
  std::filesystem::path out;     ///< see Trainer; and the weights when it ends
  nn::ModelConfig config;
  int threads = 1;  ///< parts of a step (`accumulate`) that are computed side by side, each on one core; or libtorch's
                    ///< own, where no parts are, and on a GPU
  std::function<bool()> interrupted = {};
  std::function<void(const TrainerProgress&)> on_progress = {};
  std::function<void(const std::string& sentence)> say = {};
  std::string begun_with = {};  ///< page of sizes and files of first weights, by hash: with others it is another training
  at::Device device = at::kCPU;  ///< where it is computed; what is random is the same everywhere, sums are not
};

/// How many threads share the parts of a step, each with a copy of what is trained; what the sums' last digits depend
/// on. On a GPU it is one, whose parts follow one another: memory is what they are for there.
/// @param options  that CheckOptions (trainer.h) takes
std::int64_t Workers(const JobPlace& place, const JobOptions& options);
/// What of a place decides the numbers of each step: its threads on a CPU, else the kind of device ("cuda" of "cuda:1"),
/// and what it was begun with.
std::string IdentityOf(const JobPlace& place, const JobOptions& options);
/// @throws TensorError if the shards' pictures are of other sizes than the page's or of more or fewer views, with both
void CheckPictures(const ShardSet& shards, const nn::ModelConfig& config);
/// @throws TensorError if the shards' pose maps were drawn in another way than the page says, with both
void CheckPoseMaps(const ShardSet& shards, const nn::ModelConfig& config);
/// @throws TensorError if a hold-out of no picture or window is wanted
void CheckHoldoutSize(const JobOptions& options);

/// All that TrainCodec looks at before it trains: for a training that is carried elsewhere (training_job.h).
/// @param init  as of TrainCodec
/// @throws TensorError for options that make no training, for shards that do not fit one another or the page, and for a
///   key of the page's codec that is missing in `init` or of another shape, by name
void CheckCodecTraining(const JobPlace& place, const CodecOptions& options, const std::filesystem::path& init = {});

/// Trains the codec and writes OUT/codec.safetensors: its parameters alone, latents normalised, what they are worth in
/// the metadata (psnr, psnr_object, psnr_maps: dB, hold-out; psnr_object is "unknown" where no shard knows its place). An
/// interrupted training writes none.
/// @param init  a file that holds a codec, alone or in a whole model, to go on from; empty: from nothing. A training
///              that OUT holds already goes on from there instead
/// @throws TensorError naming a key that is missing in `init` or of another shape
TrainerSummary TrainCodec(const JobPlace& place, const CodecOptions& options, const std::filesystem::path& init = {});

}  // namespace evac::train
