#pragma once

namespace evac {

/// While it lives, the first Ctrl-C (or kill, or closed terminal) ends the work in order, the second at once. A closed
/// terminal says so more than once (the kernel and the shell): that stays one. One that is made while another lives changes
/// nothing: what came before it stays so, and the outer one goes on catching. Of the main thread alone. Nor does a reader
/// who goes away (`evac run … 2>&1 | head`) end the work: what it does not take is not printed.
///
/// What the caller has ignored stays ignored: `nohup` protects from the closed terminal, and a script's `&` from Ctrl-C.
/// When it ends, each signal does what it did before.
class CatchInterrupts {
 public:
  CatchInterrupts();
  ~CatchInterrupts();
  CatchInterrupts(const CatchInterrupts&) = delete;
  CatchInterrupts& operator=(const CatchInterrupts&) = delete;
};

/// Whether one came since the last CatchInterrupts was made that was inside no other.
bool IsInterrupted();

}  // namespace evac
