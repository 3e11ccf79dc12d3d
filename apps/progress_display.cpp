#include "apps/progress_display.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
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

/// What may be drawn in place, one column and one line being left free: what wraps or scrolls away is not drawn over.
struct Room {
  std::size_t lines, columns;
};

/// Of the terminal's window as it is now; as much as is wanted where nobody knows.
Room RoomOf(std::FILE* out) {
  constexpr std::size_t kAny = std::numeric_limits<std::size_t>::max();
  winsize window{};
  const bool is_known = ::ioctl(::fileno(out), TIOCGWINSZ, &window) == 0 && window.ws_row > 0 && window.ws_col > 0;
  return is_known ? Room{window.ws_row - 1U, window.ws_col - 1U} : Room{kAny, kAny};
}

/// The first letters of UTF-8, each a column wide.
std::string Cut(const std::string& line, std::size_t columns) {
  std::size_t letters = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool begins = (static_cast<unsigned char>(line[i]) & 0xC0) != 0x80;
    if (begins && letters++ == columns) return line.substr(0, i);
  }
  return line;
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
  std::vector<std::string> lines = {Headline(progress, now), "  " + pairing_};
  for (const Progress::LaneState& lane : progress.lanes) {
    const double share = static_cast<double>(lane.chunks) / std::max(1, lane.max_chunks);
    lines.push_back(fmt::format("  {} {}", Bar(share, 12), lane.episode_id));
  }
  Draw(std::move(lines));
}

void ProgressDisplay::Say(const std::string& sentence) {
  Erase();
  Print(out_, sentence + "\n");
}

void ProgressDisplay::Draw(std::vector<std::string> lines) {
  Erase();
  const Room room = RoomOf(out_);
  if (lines.size() > room.lines) {
    const std::size_t left_out = lines.size() - room.lines + 1;
    lines.resize(room.lines);
    if (lines.size() > 2) lines.back() = fmt::format("  and {} more", left_out);  // lanes: two lines stand above them
  }
  std::string text;
  for (const std::string& line : lines) text += Cut(line, room.columns) + "\n";
  Print(out_, text);
  drawn_lines_ = static_cast<int>(lines.size());
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
  if (!terminal_) return Print(out_, text + "\n");
  Print(out_, "\r\033[K" + Cut(text, RoomOf(out_).columns) + (is_last ? "\n" : ""));
}

}  // namespace evac
