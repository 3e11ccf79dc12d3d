#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <utility>
#include <vector>

#include "apps/rate_tables.h"
#include "core/error.h"

/// Whatever the bytes: the sheet is refused with one message, or every verdict is of a clip that is there, by somebody,
/// and none is there twice.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

evac::StudyClip Clip(std::int64_t id, const char* run, const char* episode) {
  evac::StudyClip clip;
  clip.id = id;
  clip.run = run;
  clip.episode = episode;
  return clip;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<evac::StudyClip> clips = {Clip(1, "a", "e"), Clip(2, "a", "f"), Clip(3, "b", "e")};
  try {
    std::set<std::pair<std::int64_t, std::string>> seen;
    for (const evac::ImportedVerdict& verdict :
         evac::ReadRatingCsv({reinterpret_cast<const char*>(data), size}, "fuzz.csv", clips)) {
      Require(verdict.clip >= 1 && verdict.clip <= 3 && verdict.line > 1 && !verdict.rater.empty());
      Require(verdict.label == "success" || verdict.label == "failure" || verdict.label == "cannot_tell");
      Require(seen.insert({verdict.clip, verdict.rater}).second);
    }
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
