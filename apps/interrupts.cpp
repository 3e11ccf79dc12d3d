#include "apps/interrupts.h"

#include <signal.h>

#include <array>
#include <atomic>
#include <cstddef>

namespace evac {
namespace {

/// Set by a signal handler, which may run in any thread.
std::atomic<bool> g_interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// How many are alive: one inside another is a part of its work.
int g_catching = 0;

constexpr std::array kInterrupts = {SIGINT, SIGTERM, SIGHUP};
constexpr std::size_t kPipe = kInterrupts.size();  ///< where what SIGPIPE did stands, behind theirs

/// What each of them did before the outermost was made.
std::array<struct sigaction, kInterrupts.size() + 1> g_before;

}  // namespace

CatchInterrupts::CatchInterrupts() {
  if (g_catching++ > 0) return;
  g_interrupted = false;
  struct sigaction catching {};
  catching.sa_flags = SA_RESTART;
  catching.sa_handler = [](int caught) {
    g_interrupted = true;
    if (caught != SIGHUP) ::signal(caught, SIG_DFL);
  };
  for (std::size_t i = 0; i < kInterrupts.size(); ++i) {
    ::sigaction(kInterrupts[i], nullptr, &g_before[i]);
    if (g_before[i].sa_handler != SIG_IGN) ::sigaction(kInterrupts[i], &catching, nullptr);
  }
  struct sigaction ignoring {};
  ignoring.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &ignoring, &g_before[kPipe]);
}

CatchInterrupts::~CatchInterrupts() {
  if (--g_catching > 0) return;
  for (std::size_t i = 0; i < kInterrupts.size(); ++i) ::sigaction(kInterrupts[i], &g_before[i], nullptr);
  ::sigaction(SIGPIPE, &g_before[kPipe], nullptr);
}

bool IsInterrupted() { return g_interrupted; }

}  // namespace evac
