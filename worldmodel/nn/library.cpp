#include "worldmodel/nn/library.h"

#include <ATen/Context.h>
#include <torch/version.h>

namespace evac::nn {

std::string LibtorchVersion() { return TORCH_VERSION; }

bool HasCuda() { return at::hasCUDA(); }

}  // namespace evac::nn
