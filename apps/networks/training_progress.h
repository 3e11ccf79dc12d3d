#pragma once

#include <chrono>
#include <cstdio>
#include <string>

#include "worldmodel/train/trainer.h"

namespace evac {

/// How far a training is: one line, redrawn on a terminal; every half minute in a log.
class TrainingProgress {
 public:
  explicit TrainingProgress(std::FILE* out);
  ~TrainingProgress();
  void Show(const train::TrainerProgress& progress);
  /// A sentence of its own.
  void Say(const std::string& sentence);

 private:
  using Clock = std::chrono::steady_clock;
  void Erase();

  std::FILE* out_;
  bool terminal_, drawn_ = false;
  Clock::time_point last_line_;
};

}  // namespace evac
