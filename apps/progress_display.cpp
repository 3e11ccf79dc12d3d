#include "apps/progress_display.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace evac {
namespace {

constexpr auto kBetweenLines = std::chrono::seconds(10);
constexpr auto kBetweenDraws = std::chrono::milliseconds(100);

/// The terminal may be closed by now: nobody is there to be told.
void Print(std::FILE* out, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), out);
  std::fflush(out);
}

std::string Bar(double share, int width) {
  const int full = std::clamp(static_cast<int>(std::lround(share * width)), 0, width);
  std::string bar;
  for (int i = 0; i < width; ++i) bar += i < full ? "━" : "╌";
  return bar;
}

}  // namespace

std::string Duration(double seconds) {
  const long s = std::lround(std::max(0.0, seconds));
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
}

ProgressDisplay::ProgressDisplay(int total, int done_before, std::FILE* out)
    : total_(total), done_before_(done_before), out_(out), terminal_(::isatty(::fileno(out)) == 1), started_(Clock::now()), last_line_(started_) {}

ProgressDisplay::~ProgressDisplay() { Erase(); }

void ProgressDisplay::Begin(const std::string& pairing) {
  done_earlier_ += last_.done;
  failed_earlier_ += last_.failed;
  last_ = {};
  pairing_ = pairing;
  if (!terminal_) Say(fmt::format("{}: {} of {} episodes done so far", pairing, done_before_ + done_earlier_, total_));
}

std::string ProgressDisplay::Headline(const Progress& progress, Clock::time_point now) const {
  const int fresh = done_earlier_ + progress.done, done = done_before_ + fresh, failed = failed_earlier_ + progress.failed;
  const double elapsed_s = std::chrono::duration<double>(now - started_).count();
  const double rate = elapsed_s > 0 ? fresh / elapsed_s : 0;
  const std::string left = fresh > 0 ? Duration((total_ - done) / rate) + " left" : "time left not known yet";
  return fmt::format("{} {}/{} episodes, {} failed, {:.1f}/min, {}", Bar(total_ ? static_cast<double>(done) / total_ : 1, 24), done, total_, failed,
                     60 * rate, left);
}

void ProgressDisplay::Show(const Progress& progress, Clock::time_point now) {
  last_ = progress;
  if (now - last_line_ < (terminal_ ? Clock::duration(kBetweenDraws) : Clock::duration(kBetweenLines))) return;
  last_line_ = now;
  if (!terminal_) return Say(pairing_ + ": " + Headline(progress, now));
  std::string text = fmt::format("{}\n  {}\n", Headline(progress, now), pairing_);
  for (const Progress::LaneState& lane : progress.lanes) {
    text += fmt::format("  {} {}\n", Bar(static_cast<double>(lane.chunks) / std::max(1, lane.max_chunks), 12), lane.episode_id);
  }
  Draw(text, 2 + static_cast<int>(progress.lanes.size()));
}

void ProgressDisplay::Say(const std::string& sentence) {
  Erase();
  Print(out_, sentence + "\n");
}

void ProgressDisplay::Draw(const std::string& text, int lines) {
  Erase();
  Print(out_, text);
  drawn_lines_ = lines;
}

void ProgressDisplay::Erase() {
  if (drawn_lines_ > 0) Print(out_, fmt::format("\033[{}F\033[J", drawn_lines_));
  drawn_lines_ = 0;
}

CountDisplay::CountDisplay(std::string things, std::FILE* out)
    : things_(std::move(things)), out_(out), terminal_(::isatty(::fileno(out)) == 1), started_(Clock::now()), last_line_(started_) {}

void CountDisplay::Show(std::size_t done, std::size_t of, Clock::time_point now) {
  const bool is_last = done >= of;
  if (!is_last && now - last_line_ < (terminal_ ? Clock::duration(kBetweenDraws) : Clock::duration(kBetweenLines))) return;
  last_line_ = now;
  std::string text = fmt::format("{} of {} {}", done, of, things_);
  if (!is_last && done > 0) {
    const double each_s = std::chrono::duration<double>(now - started_).count() / static_cast<double>(done);
    text += fmt::format(", {} left", Duration(each_s * static_cast<double>(of - done)));
  }
  Print(out_, terminal_ ? "\r\033[K" + text + (is_last ? "\n" : "") : text + "\n");
}

}  // namespace evac
