#include "apps/interrupts.h"

#include <atomic>
#include <csignal>

namespace evac {
namespace {

/// Set by a signal handler, which may run in any thread.
std::atomic<bool> g_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// How many are alive: one inside another is a part of its work.
int g_catching = 0;

constexpr int kInterrupts[] = {SIGINT, SIGTERM, SIGHUP};

}  // namespace

CatchInterrupts::CatchInterrupts() {
  if (g_catching++ > 0) return;
  g_interrupted = false;
  for (const int signal : kInterrupts) {
    std::signal(signal, [](int caught) {
      g_interrupted = true;
      if (caught != SIGHUP) std::signal(caught, SIG_DFL);
    });
  }
}

CatchInterrupts::~CatchInterrupts() {
  if (--g_catching > 0) return;
  for (const int signal : kInterrupts) std::signal(signal, SIG_DFL);
}

bool IsInterrupted() { return g_interrupted; }

}  // namespace evac
