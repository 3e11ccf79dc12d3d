#include "apps/progress_display.h"

#include <gmock/gmock.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

namespace evac {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// A terminal's window of that many rows and columns; 0: nobody knows.
class Window {
 public:
  Window(unsigned short rows, unsigned short columns) {
    const winsize size{.ws_row = rows, .ws_col = columns, .ws_xpixel = 0, .ws_ypixel = 0};
    int terminal = -1;
    EXPECT_EQ(::openpty(&seen_, &terminal, nullptr, nullptr, &size), 0);
    out_ = ::fdopen(terminal, "w");
  }
  ~Window() {
    std::fclose(out_);
    ::close(seen_);
  }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  std::FILE* out() { return out_; }

  /// What was written since this was asked last, by lines; the last is what no line's end came after.
  std::vector<std::string> Lines() {
    constexpr char kEnd = '\f';  // what nobody writes but this
    std::fputc(kEnd, out_);
    std::fflush(out_);
    std::string text;
    for (char letter = 0; ::read(seen_, &letter, 1) == 1 && letter != kEnd;) text += letter;
    std::vector<std::string> lines = {""};
    for (const char letter : text) {
      if (letter == '\n') lines.emplace_back();
      if (letter != '\n' && letter != '\r') lines.back() += letter;
    }
    return lines;
  }

 private:
  int seen_ = -1;
  std::FILE* out_ = nullptr;
};

int Columns(const std::string& line) {
  return static_cast<int>(std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

Progress OfLanes(int count) {
  Progress progress;
  for (int i = 0; i < count; ++i)
    progress.lanes.push_back({fmt::format("real/take_bottle/visual_pick@good/41-{:04}-s1", i), 1, 2});
  return progress;
}

/// It went up by as many lines as it had written, and the window had scrolled, or wrapped them, since.
TEST(ProgressDisplay, DrawsNoMoreThanItsWindowHoldsAndGoesUpByAsMuch) {
  Window window(8, 40);
  ProgressDisplay display(60, 0, window.out());
  display.Begin("real · visual_pick@good");
  const auto start = ProgressDisplay::Clock::now();
  std::string up;
  for (int second = 1; second <= 3; ++second) {
    display.Show(OfLanes(second == 3 ? 2 : 30), start + std::chrono::seconds(second));
    std::vector<std::string> lines = window.Lines();
    EXPECT_THAT(lines.front(), StartsWith(up));
    lines.front().erase(0, up.size());
    EXPECT_EQ(lines.back(), "");
    lines.pop_back();
    ASSERT_EQ(lines.size(), second == 3 ? 4u : 7u) << "one line is the cursor's";
    for (const std::string& line : lines) EXPECT_LT(Columns(line), 40) << line;
    EXPECT_THAT(lines[0], StartsWith("╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌ 0/60 episodes"));
    EXPECT_EQ(lines[1], "  real · visual_pick@good");
    EXPECT_THAT(lines[2], StartsWith("  ━━━━━━╌╌╌╌╌╌ real/take_bottle"));
    EXPECT_EQ(lines.back() == "  and 26 more", second < 3) << lines.back();
    up = fmt::format("\033[{}F\033[J", lines.size());
  }
}

TEST(ProgressDisplay, DrawsAllWhereNobodyKnowsTheWindow) {
  Window window(0, 0);
  ProgressDisplay display(60, 0, window.out());
  display.Show(OfLanes(30), ProgressDisplay::Clock::now() + std::chrono::seconds(1));
  const std::vector<std::string> lines = window.Lines();
  ASSERT_EQ(lines.size(), 2u + 30u + 1u);
  EXPECT_THAT(lines[0], HasSubstr("time left not known yet"));
  EXPECT_THAT(lines[31], HasSubstr("41-0029-s1"));
}

TEST(CountDisplay, OnATerminalItsLineIsNoLongerThanTheWindowIsWide) {
  Window window(8, 12);
  CountDisplay display("clips of all episodes", window.out());
  display.Show(40, 40);
  EXPECT_EQ(window.Lines(), (std::vector<std::string>{"\033[K40 of 40 cl", ""}));
}

TEST(CountDisplay, InALogEverySayIsALineOfItsOwnAndTheyAreFew) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> log(std::tmpfile(), std::fclose);
  CountDisplay display("clips", log.get());
  const auto start = CountDisplay::Clock::now();
  for (int done = 1; done <= 40; ++done) display.Show(done, 40, start + std::chrono::seconds(done));
  std::rewind(log.get());
  std::string text(4096, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), log.get()));
  EXPECT_THAT(text, testing::StartsWith("10 of 40 clips, 30 s left\n20 of 40 clips, 20 s left\n"));
  EXPECT_THAT(text, testing::EndsWith("\n40 of 40 clips\n"));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("\r")));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
}

}  // namespace
}  // namespace evac
