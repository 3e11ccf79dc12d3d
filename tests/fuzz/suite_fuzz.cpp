#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/config.h"
#include "core/task_page.h"
#include "harness/suite.h"

/// Any text is a suite or a task page, or an InvalidInput; what is a page means the same when it is written and read
/// again. The first byte says what it is to be read as. No suite gets to files: those that it names are not there.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const evac::Config page = evac::Config::FromText(text, "/nowhere/page.yaml");
    if (evac::Config::FromText(page.Text(), "/nowhere/page.yaml").Canonical() != page.Canonical()) std::abort();
    if (data[0] % 2) {
      evac::ParseSuite(text, "/nowhere/suite.yaml");
    } else {
      evac::ParseTaskPage(text, "/nowhere/task.yaml");
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
