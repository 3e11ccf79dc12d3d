#include "worldmodel/nn/library.h"

#include <ATen/Context.h>
#include <dlfcn.h>
#include <torch/version.h>

#include "worldmodel/nn/processors.h"

namespace evac::nn {
namespace {

/// "SkylakeX"; "none" where libtorch multiplies with something else.
std::string BlasCore() {
  const auto name = reinterpret_cast<const char* (*)()>(::dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  return name ? name() : "none";
}

}  // namespace

std::string LibtorchVersion() { return TORCH_VERSION; }

std::string Arithmetic() {
  return "libtorch " + LibtorchVersion() + " blas " + BlasCore() + " kernels " + PickedProcessor();
}

bool HasCuda() { return at::hasCUDA(); }

}  // namespace evac::nn
