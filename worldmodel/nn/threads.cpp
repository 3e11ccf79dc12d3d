#include "worldmodel/nn/threads.h"

#include <ATen/Parallel.h>
#include <dlfcn.h>

namespace evac::nn {
namespace {

/// Where libtorch multiplies with OpenBLAS, which has threads of its own; 0 and nothing elsewhere.
int BlasThreads() {
  const auto get = reinterpret_cast<int (*)()>(::dlsym(RTLD_DEFAULT, "openblas_get_num_threads"));
  return get ? get() : 0;
}

void SetBlasThreads(int count) {
  const auto set = reinterpret_cast<void (*)(int)>(::dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
  if (set && count > 0) set(count);
}

}  // namespace

LibraryThreads::LibraryThreads(int count) : before_(at::get_num_threads()), blas_before_(BlasThreads()) {
  UseLibraryThreadsForGood(count);
}

LibraryThreads::~LibraryThreads() {
  at::set_num_threads(before_);
  SetBlasThreads(blas_before_);
}

void UseLibraryThreadsForGood(int count) {
  at::set_num_threads(count);
  SetBlasThreads(count);
}

void UseLibraryThreadsHere(int count) { at::set_num_threads(count); }

}  // namespace evac::nn
