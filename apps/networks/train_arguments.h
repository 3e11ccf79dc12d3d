#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/networks/training_progress.h"
#include "core/error.h"
#include "core/store_lock.h"
#include "worldmodel/train/train_codec.h"

namespace evac {

/// What every `evac train …` is told.
struct TrainArguments {
  std::vector<std::string> shards;
  std::string config, training, out, codec, forecast, init, job, device = "cpu";
  std::vector<std::string> settings, init_except;
  std::vector<std::int64_t> keep_steps;
  std::optional<double> minutes;
  std::optional<std::int64_t> steps;
  int threads = 0;
  bool init_widen = false, calibrate_only = false;
};

/// Adds what all trainings share: --training, --set, --minutes, --steps, --threads, --out.
void AddTraining(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments);
/// The same and SHARDS.
void AddShared(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments);

/// Adds --device, and --job, with which --out is not wanted: of trainings that can be carried to another machine.
void AddElsewhere(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments);

/// Adds --config, the page of the network's sizes.
CLI::Option* AddConfig(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments);

/// What the command line says beside the page.
void Override(const TrainArguments& arguments, train::TrainerOptions& options);

/// @param arguments, progress  outlive what is returned. Its `config` is read from --config, if that was given.
/// @throws InvalidInput for a --device that libtorch has not
train::JobPlace PlaceOf(const TrainArguments& arguments, TrainingProgress& progress);

/// OUT, made and held for this process: two trainings would write one another's files. Where an exception ends it
/// before a training has begun there, what was made for it is removed: OUT/lock, OUT/begun_by, the folders.
class HeldFolder {
 public:
  /// @throws InvalidInput naming the process that holds it, or if no OUT was given
  explicit HeldFolder(const std::filesystem::path& out);
  ~HeldFolder();
  HeldFolder(const HeldFolder&) = delete;
  HeldFolder& operator=(const HeldFolder&) = delete;

 private:
  std::filesystem::path out_;
  std::vector<std::filesystem::path> made_;  ///< what was not there before, what lies within a folder before it
  RunLock lock_;
  int exceptions_ = std::uncaught_exceptions();
};

/// Writes into OUT/begun_by which version of evac begins the training; where another began the one that is there, a
/// note on stderr says so. Needs a HeldFolder.
void KeepWhoBegan(const std::filesystem::path& out);

/// Threads that share the parts of a step use one core each.
int LibraryThreadsOf(const train::JobPlace& place, const train::JobOptions& options);

/// Says how it ended.
ExitCode End(const train::TrainerSummary& summary, const std::filesystem::path& out, const char* file);

}  // namespace evac
