#include "worldmodel/nn/library.h"

#include <ATen/Context.h>
#include <dlfcn.h>
#include <torch/version.h>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include "worldmodel/nn/processors.h"

namespace evac::nn {
namespace {

/// "SkylakeX"; "none" where libtorch multiplies with something else.
std::string BlasCore() {
  const auto name = reinterpret_cast<const char* (*)()>(::dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  return name ? name() : "none";
}

/// What this processor has to multiply bf16 by, which libtorch's kernels use where it is there, each with a rounding of
/// its own: "avx512bf16 amx-bf16"; "none". By the instruction itself: older compilers have no names for them.
std::string UnitsOfBf16() {
  std::string units;
#if defined(__x86_64__)
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  if (__get_cpuid_count(7, 1, &eax, &ebx, &ecx, &edx) != 0 && (eax & (1U << 5)) != 0) units += "avx512bf16";
  if (__get_cpuid_count(7, 0, &eax, &ebx, &ecx, &edx) != 0 && (edx & (1U << 22)) != 0)
    units += units.empty() ? "amx-bf16" : " amx-bf16";
#endif
  return units.empty() ? "none" : units;
}

}  // namespace

std::string LibtorchVersion() { return TORCH_VERSION; }

std::string Arithmetic() {
  return "libtorch " + LibtorchVersion() + " blas " + BlasCore() + " kernels " + PickedProcessor() + " bf16 " +
         UnitsOfBf16();
}

bool HasCuda() { return at::hasCUDA(); }

}  // namespace evac::nn
