#include <cstdint>
#include <cstdlib>
#include <string>

#include "apps/networks/imagined_page.h"
#include "core/error.h"

namespace {

using Json = nlohmann::json;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// What is asked for where another job's page may lie: one of each kind of field.
Json Wanted() {
  return {{"eta", 1.0},
          {"reference_quirks", {{"residual_noise", false}}},
          {"seed", 9},
          {"solver", "ddim"},
          {"statistics", {{"mean", {0, 0.5}}}}};
}

}  // namespace

/// Any text is the page of a job, which is the same as itself, written and read again too, and can be told from another
/// in one line; or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const Json job = evac::JobOnPage(std::string(reinterpret_cast<const char*>(data), size), "imagined.json");
    Require(job.is_object() && evac::DifferencesOf(job, job).empty());
    Json page;
    page["job"] = job;
    Require(evac::DifferencesOf(job, evac::JobOnPage(page.dump(2), "again")).empty());
    const std::string differences = evac::DifferencesOf(Wanted(), job);
    Require(differences.find('\n') == std::string::npos && differences.size() < 1000);
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
