#pragma once

#include <string>

#include "apps/interrupts.h"
#include "apps/networks/train_arguments.h"
#include "apps/networks/training_page.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/train/option_limits.h"

namespace evac {

/// One of the trainings of `evac train`.
struct TrainingKind {
  std::string section;    ///< of the training page
  std::string file;       ///< in OUT, what it makes
  bool is_small = false;  ///< gains nothing from a library's threads
};

/// Calls `function`; an option that it refuses is said with the place where it was given.
/// @param section  of the training page
template <class Function>
auto SayingWhere(const TrainArguments& arguments, const std::string& section, const Function& function) {
  try {
    return function();
  } catch (const train::OptionError& error) {
    throw TensorError(WhereGiven(arguments.training, section, arguments.settings, error.option()) + error.what());
  }
}

/// What all trainings do around their own part: page, command line, progress, interrupts, threads, one process in OUT.
/// @param train  (const train::JobPlace&, const Options&) → train::TrainerSummary
template <class Options, class Train>
ExitCode RunTraining(const TrainArguments& arguments, const TrainingKind& kind, const Train& train) {
  Options options;
  ReadTrainingPage(arguments.training, kind.section, arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  // Before OUT is made, and threads are shared out among the parts of a step.
  SayingWhere(arguments, kind.section, [&] { train::CheckOptions(options.job.trainer); });
  const CatchInterrupts catch_interrupts;
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  CheckHoldouts(place.shards);
  const HeldFolder folder(arguments.out);
  KeepWhoBegan(arguments.out);
  nn::KeepFreedMemory();
  const nn::LibraryThreads threads(kind.is_small ? 1 : LibraryThreadsOf(place, options.job));
  const train::TrainerSummary summary =
      SayingWhere(arguments, kind.section, [&] { return train(place, options); });
  return End(summary, arguments.out, kind.file.c_str());
}

}  // namespace evac
