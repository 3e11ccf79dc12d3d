#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/recording_parts.h"

/// The first byte says what the others are: a camera's intrinsics or extrinsics. They are read, or there is an
/// InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    if (data[0] == 'i') evac::ParseIntrinsics(bytes, "fuzz.json");
    if (data[0] == 'e') evac::ParseExtrinsics(bytes, "fuzz.json");
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
