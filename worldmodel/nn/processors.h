#pragma once

/// Put before a function: it is compiled for several processors, and the best is picked when the program starts.
/// Sanitizers come before the picking does, and clang has no such thing here: then there is one, for the plainest.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define EVAC_PICKS_PROCESSOR 1
#if __GNUC__ >= 12
#define EVAC_EACH_PROCESSOR __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else  // knows no levels; without fused multiply-add on processors of 256 bits
#define EVAC_EACH_PROCESSOR __attribute__((target_clones("avx512f", "avx2", "default")))
#endif
#else
#define EVAC_PICKS_PROCESSOR 0
#define EVAC_EACH_PROCESSOR
#endif

namespace evac::nn {

/// Which of them is picked on this processor: they round differently.
inline const char* PickedProcessor() {
#if EVAC_PICKS_PROCESSOR && __GNUC__ >= 12
  if (__builtin_cpu_supports("x86-64-v4")) return "x86-64-v4";
  if (__builtin_cpu_supports("x86-64-v3")) return "x86-64-v3";
#elif EVAC_PICKS_PROCESSOR
  if (__builtin_cpu_supports("avx512f")) return "avx512f";
  if (__builtin_cpu_supports("avx2")) return "avx2";
#endif
  return "default";
}

}  // namespace evac::nn
