#pragma once

/// How many threads the libraries may use. OpenMP counts per calling thread, libtorch for those it has not met yet,
/// OpenBLAS for everybody: so there are two calls.
namespace evac::nn {

/// While it lives, what this thread asks of the libraries is done by `count` threads. One at a time per process, and not
/// until its end, as what is static lives: to put the number back clears libtorch's caches of this thread, which are
/// gone by then.
class LibraryThreads {
 public:
  explicit LibraryThreads(int count);
  ~LibraryThreads();
  LibraryThreads(const LibraryThreads&) = delete;
  LibraryThreads& operator=(const LibraryThreads&) = delete;

 private:
  int before_, blas_before_;
};

/// The same for the rest of the process: nothing is put back. Once, before other threads ask for anything.
void UseLibraryThreadsForGood(int count);

/// The same for a new thread that works while a LibraryThreads(count) lives elsewhere; for as long as the thread lives.
void UseLibraryThreadsHere(int count);

}  // namespace evac::nn
