#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/collection.h"
#include "core/error.h"
#include "core/recording_parts.h"

/// The first byte says what the others are: a camera's intrinsics or extrinsics, or a row of a collection. They are read,
/// or there is an InvalidInput; a row that was read is written and read again as the same.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  try {
    if (data[0] == 'i') evac::ParseIntrinsics(bytes, "fuzz.json");
    if (data[0] == 'e') evac::ParseExtrinsics(bytes, "fuzz.json");
    if (data[0] == 'r') {
      const std::string row = evac::CollectedJson(evac::ParseCollected(bytes, "fuzz.json"));
      if (evac::CollectedJson(evac::ParseCollected(row, "written.json")) != row) std::abort();
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
