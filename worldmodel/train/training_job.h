#pragma once

#include <filesystem>
#include <string>

#include "worldmodel/train/settings.h"
#include "worldmodel/train/train_world.h"

/// A training that is carried to another machine (docs/train_on_gpu.md): what the pages and the command line say, in one
/// file of lines "name value", for a program that reads no pages. Shards and weights are carried beside it.
namespace evac::train {

enum class TrainingKind { kCodec, kWorld };

struct TrainingJob {
  TrainingKind kind = TrainingKind::kWorld;
  nn::ModelConfig config;
  CodecOptions codec;  ///< of a codec's training
  WorldOptions world;  ///< of a world model's
  /// Of the latter: the files' names are given again where they are carried to, the rest is here.
  WorldStart start;
  bool wants_init = false, wants_forecast = false;  ///< weights that the training begins with
  /// Of these files, SHA-256, as `start.codec_sha256` is of the codec's tensors (sha256.h); empty: not asked.
  std::string init_sha256, forecast_sha256;
  std::string recipe;  ///< of the shards (RecipesOf); empty: not asked
  std::string begun_with;  ///< JobPlace::begun_with

  const JobOptions& options() const { return kind == TrainingKind::kCodec ? codec.job : world.job; }
};

/// The job as text; read again it is the same, to the last digit.
std::string TextOf(const TrainingJob& job);
/// @param name  of the file, for messages
/// @throws TensorError naming file and line: not such a file, one that was cut off on its way, an unknown name, a value
///   that its field cannot have, or sizes that make no network
TrainingJob ParseTrainingJob(const std::string& text, const std::string& name);

/// @throws TensorError if it cannot be written, or what is there is no job; nothing is there then, or what was
void WriteTrainingJob(const std::filesystem::path& path, const TrainingJob& job);
/// @throws TensorError as ParseTrainingJob, or if the file cannot be read
TrainingJob ReadTrainingJob(const std::filesystem::path& path);

}  // namespace evac::train
