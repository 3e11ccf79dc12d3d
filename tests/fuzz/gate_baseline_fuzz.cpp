#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "reports/gate_baseline.h"

/// Whatever the bytes: they are refused with one message, or are a pinned result that is written again as it was read.
/// Every field is looked at before the file's hash is, so that the fuzzer is not stopped at the door.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::PinnedResult pinned =
        evac::ReadPinned(std::string(reinterpret_cast<const char*>(data), size), "fuzz.json");
    const evac::PinnedResult again = evac::ReadPinned(evac::PinnedJson(pinned), "again.json");
    Require(again.sha256 == pinned.sha256 && evac::PinnedJson(again) == evac::PinnedJson(pinned));
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
