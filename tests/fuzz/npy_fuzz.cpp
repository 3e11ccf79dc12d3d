#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/npy.h"

/// Any bytes are an array that survives being written and read again, or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::NpyArray array = evac::ParseNpy({reinterpret_cast<const char*>(data), size}, "fuzz");
    if (array.dtype == "<i8") return 0;  // beyond 2^53 it is rounded, by contract
    const evac::NpyArray again = evac::ParseNpy(evac::NpyBytes(array), "again");
    if (again.shape != array.shape || again.values.size() != array.values.size()) std::abort();
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
