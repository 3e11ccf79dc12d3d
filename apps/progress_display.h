#pragma once

#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "harness/rollout.h"

namespace evac {

/// Shows a run while it works: done, failed, rate, time left and every lane on a terminal (redrawn in place), plain lines now
/// and then in a log. In a small window it draws what fits: the lines' beginnings, the first lanes, and how many more there
/// are. Writes to stderr: stdout stays for results.
class ProgressDisplay {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param total         episodes of the whole run
  /// @param done_before   of those, already stored when this process started
  ProgressDisplay(int total, int done_before, std::FILE* out);
  ~ProgressDisplay();

  /// A new pairing begins: "real · visual_pick@fair". What is shown next counts from what is done so far.
  void Begin(const std::string& pairing);
  void Show(const Progress& progress, Clock::time_point now);
  /// A sentence of its own, above the display.
  void Say(const std::string& sentence);

 private:
  std::string Headline(const Progress& progress, Clock::time_point now) const;
  void Draw(std::vector<std::string> lines);
  void Erase();

  int total_, done_before_;
  int done_earlier_ = 0, failed_earlier_ = 0;  ///< by the pairings before this one, in this process
  Progress last_;
  std::string pairing_;
  std::FILE* out_;
  bool terminal_;
  int drawn_lines_ = 0;
  Clock::time_point started_, last_line_;
};

/// "12 of 96 clips, 40 s left": redrawn in place on a terminal, as far as its window is wide; a line now and then in a
/// log.
class CountDisplay {
 public:
  using Clock = std::chrono::steady_clock;

  CountDisplay(std::string things, std::FILE* out);
  void Show(std::size_t done, std::size_t of, Clock::time_point now = Clock::now());

 private:
  std::string things_;
  std::FILE* out_;
  bool terminal_;
  Clock::time_point started_, last_line_;
};

/// "42 s", "3 min 05 s", "2 h 07 min".
std::string Duration(double seconds);

}  // namespace evac
