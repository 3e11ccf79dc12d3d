#pragma once

#include <string>

#include "apps/interrupts.h"
#include "apps/networks/train_arguments.h"
#include "apps/networks/training_page.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/threads.h"

namespace evac {

/// One of the trainings of `evac train`.
struct TrainingKind {
  std::string section;    ///< of the training page
  std::string file;       ///< in OUT, what it makes
  bool is_small = false;  ///< gains nothing from a library's threads
};

/// What all trainings do around their own part: page, command line, progress, interrupts, threads, one process in OUT.
/// @param train  (const train::JobPlace&, const Options&) → train::TrainerSummary
template <class Options, class Train>
ExitCode RunTraining(const TrainArguments& arguments, const TrainingKind& kind, const Train& train) {
  Options options;
  ReadTrainingPage(arguments.training, kind.section, arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  train::CheckOptions(options.job.trainer);  // before OUT is made, and threads are shared out among the parts of a step
  const CatchInterrupts catch_interrupts;
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  CheckHoldouts(place.shards);
  const RunLock lock = HoldFolder(arguments.out);
  KeepWhoBegan(arguments.out);
  nn::KeepFreedMemory();
  const nn::LibraryThreads threads(kind.is_small ? 1 : LibraryThreadsOf(place, options.job));
  return End(train(place, options), arguments.out, kind.file.c_str());
}

}  // namespace evac
