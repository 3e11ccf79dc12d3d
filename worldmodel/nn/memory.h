#pragma once

namespace evac::nn {

/// From now on this process keeps the memory it frees and uses it again, where the C library can be told so (glibc).
/// Otherwise every large tensor is a new mapping whose pages the kernel clears anew: a fifth of the time of a full-size
/// network's call. The process never grows beyond its own largest need. For programs that do little but imagine.
void KeepFreedMemory();

}  // namespace evac::nn
