#pragma once

#include <chrono>
#include <cstdio>
#include <string>

namespace evac {

/// Shows how far `evac imagine` is: after every step of the sampler on a terminal (one line, redrawn), every ten
/// seconds and at each chunk's end in a log. Writes to stderr: stdout stays for results.
class ImagineProgress {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param steps  of the sampler per chunk
  ImagineProgress(std::size_t chunks, std::size_t steps, std::FILE* out);
  ~ImagineProgress();

  void SkipChunk();  ///< it was there already
  void Step();
  void FinishChunk();
  /// A sentence of its own.
  void Say(const std::string& sentence);

 private:
  void Show();
  std::string Line() const;
  void Erase();

  std::size_t chunks_, steps_;
  std::size_t chunk_ = 0, step_ = 0;  ///< chunks done, steps done of the next
  std::size_t fresh_steps_ = 0;       ///< by this process
  std::FILE* out_;
  bool terminal_, drawn_ = false;
  Clock::time_point started_, last_line_;
};

}  // namespace evac
