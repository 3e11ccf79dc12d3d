#pragma once

#include <string>

/// The libtorch that this program runs with.
namespace evac::nn {

/// "1.13.0".
std::string LibtorchVersion();
/// Whether it can use a GPU here.
bool HasCuda();

}  // namespace evac::nn
