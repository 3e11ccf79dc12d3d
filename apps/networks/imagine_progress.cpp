#include "apps/networks/imagine_progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include "apps/progress_display.h"

namespace evac {
namespace {

constexpr auto kBetweenLines = std::chrono::seconds(10);

void Print(std::FILE* out, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), out);
  std::fflush(out);
}

}  // namespace

ImagineProgress::ImagineProgress(std::size_t chunks, std::size_t steps, std::FILE* out)
    : chunks_(chunks),
      steps_(steps),
      out_(out),
      terminal_(::isatty(::fileno(out)) == 1),
      started_(Clock::now()),
      last_line_(started_) {}

ImagineProgress::~ImagineProgress() { Erase(); }

void ImagineProgress::SkipChunk() { ++chunk_; }

void ImagineProgress::Step() {
  ++step_;
  ++fresh_steps_;
  if (terminal_ || Clock::now() - last_line_ > kBetweenLines) Show();
}

void ImagineProgress::FinishChunk() {
  ++chunk_;
  step_ = 0;
  Show();
}

void ImagineProgress::Say(const std::string& sentence) {
  Erase();
  Print(out_, sentence + "\n");
}

std::string ImagineProgress::Line() const {
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - started_).count();
  const double to_do = static_cast<double>((chunks_ - chunk_) * steps_ - step_);
  const std::string left = fresh_steps_ == 0
                               ? std::string("time left not known yet")
                               : Duration(elapsed_s / static_cast<double>(fresh_steps_) * to_do) + " left";
  if (chunk_ == chunks_) return fmt::format("chunk {0} of {0} done, {1}", chunks_, Duration(elapsed_s));
  return fmt::format("chunk {} of {}, step {} of {}, {}", chunk_ + 1, chunks_, step_, steps_, left);
}

void ImagineProgress::Show() {
  last_line_ = Clock::now();
  Erase();
  Print(out_, Line() + (terminal_ ? "" : "\n"));
  drawn_ = terminal_;
}

void ImagineProgress::Erase() {
  if (drawn_) Print(out_, "\r\033[K");
  drawn_ = false;
}

}  // namespace evac
