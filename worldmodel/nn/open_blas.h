#pragma once

#include <cstdlib>

namespace evac::nn {

/// OpenBLAS picks its kernels by the processor's model number when it is loaded, and takes its oldest for a number that
/// it does not know: programs that are started from here on are told what a newer processor can. What the user says
/// counts.
/// @returns whether they are told something that this program was not
inline bool TellOpenBlasTheProcessor() {
#if defined(__x86_64__)
  if (std::getenv("OPENBLAS_CORETYPE") == nullptr && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return ::setenv("OPENBLAS_CORETYPE", "SKYLAKEX", 0) == 0;
#endif
  return false;
}

}  // namespace evac::nn
