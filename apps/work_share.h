#pragma once

#include <cstdint>
#include <functional>

namespace evac {

/// Calls `work` once for each item 0 … count - 1 on up to `threads` threads (0: one per core), any order; then `done`
/// for that item, one at a time. The first error, a thread that cannot be started too, ends the rest and is thrown again.
void ShareOut(std::int64_t count, int threads, const std::function<void(std::int64_t)>& work,
              const std::function<void(std::int64_t)>& done);

/// As many as `threads` says, or one per core.
int ThreadsOrCores(int threads);

/// "412 of 3000 episodes, 96 a minute, 26 min 57 s left", every few seconds, on stderr.
class CountProgress {
 public:
  /// @param noun  what is counted, plural
  CountProgress(const char* noun, std::int64_t total, std::int64_t done_before);
  void Count();

 private:
  const char* noun_;
  std::int64_t total_, before_, done_;
  double started_s_, shown_s_;
};

}  // namespace evac
