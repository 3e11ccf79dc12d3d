#pragma once

namespace evac {

/// While it lives, the first Ctrl-C (or kill, or closed terminal) ends the work in order, the second at once. A closed
/// terminal says so more than once (the kernel and the shell): that stays one.
class CatchInterrupts {
 public:
  CatchInterrupts();
  ~CatchInterrupts();
  CatchInterrupts(const CatchInterrupts&) = delete;
  CatchInterrupts& operator=(const CatchInterrupts&) = delete;
};

/// Whether one came since the last CatchInterrupts was made.
bool IsInterrupted();

}  // namespace evac
