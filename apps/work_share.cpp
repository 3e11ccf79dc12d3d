#include "apps/work_share.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "apps/progress_display.h"
#include "core/error.h"

namespace evac {
namespace {

constexpr double kBetweenLines_s = 5;

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

int ThreadsOrCores(int threads) {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ShareOut(std::int64_t count, int threads, const std::function<void(std::int64_t)>& work,
              const std::function<void(std::int64_t)>& done) {
  std::mutex mutex;  // guards all below
  std::int64_t next = 0;
  std::exception_ptr first_error;
  const auto work_on = [&] {
    for (;;) {
      std::unique_lock lock(mutex);
      if (first_error || next == count) return;
      const std::int64_t item = next++;
      lock.unlock();
      std::exception_ptr error;
      try {
        work(item);
      } catch (...) {
        error = std::current_exception();
      }
      lock.lock();
      if (error && !first_error) first_error = error;
      if (!error) done(item);
    }
  };
  std::vector<std::thread> team;
  const std::int64_t size = std::min<std::int64_t>(ThreadsOrCores(threads), count);
  try {
    for (std::int64_t i = 0; i < size; ++i) team.emplace_back(work_on);
  } catch (const std::system_error& error) {  // those that are there end before it is thrown
    const std::lock_guard lock(mutex);
    if (!first_error)
      first_error = std::make_exception_ptr(InternalError("cannot start {} threads: {}", size, error.what()));
  }
  for (std::thread& one : team) one.join();
  if (first_error) std::rethrow_exception(first_error);
}

CountProgress::CountProgress(const char* noun, std::int64_t total, std::int64_t done_before)
    : noun_(noun), total_(total), before_(done_before), done_(done_before), started_s_(Now()), shown_s_(started_s_) {}

void CountProgress::Count() {
  ++done_;
  const double now_s = Now();
  if (now_s - shown_s_ < kBetweenLines_s && done_ < total_) return;
  shown_s_ = now_s;
  const double rate_hz = static_cast<double>(done_ - before_) / std::max(1e-9, now_s - started_s_);
  const std::string left = Duration(static_cast<double>(total_ - done_) / rate_hz);
  std::fputs(fmt::format("{} of {} {}, {:.0f} a minute, {} left\n", done_, total_, noun_, 60 * rate_hz, left).c_str(),
             stderr);
}

}  // namespace evac
