#include "apps/networks/training_progress.h"

#include <fmt/format.h>
#include <unistd.h>

namespace evac {
namespace {
constexpr double kTerminalEvery_s = 0.2, kLogEvery_s = 30;
}  // namespace

TrainingProgress::TrainingProgress(std::FILE* out) : out_(out), terminal_(::isatty(::fileno(out)) != 0) {}

TrainingProgress::~TrainingProgress() { Erase(); }

void TrainingProgress::Erase() {
  if (drawn_) std::fputs("\r\033[K", out_);
  drawn_ = false;
}

void TrainingProgress::Show(const train::TrainerProgress& progress) {
  const double since_s = std::chrono::duration<double>(Clock::now() - last_line_).count();
  if (since_s < (terminal_ ? kTerminalEvery_s : kLogEvery_s)) return;
  last_line_ = Clock::now();
  Erase();
  std::fputs((progress.Line() + (terminal_ ? "" : "\n")).c_str(), out_);
  std::fflush(out_);
  drawn_ = terminal_;
}

void TrainingProgress::Say(const std::string& sentence) {
  Erase();
  std::fputs((sentence + "\n").c_str(), out_);
}

}  // namespace evac
