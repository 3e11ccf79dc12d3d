#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/store_study.h"
#include "tests/fuzz/scratch.h"

namespace {

void ReadPerson(const evac::StudyStore& study, std::int64_t rater) {
  for (const evac::Presentation& shown : study.PresentationsOf(rater)) {
    study.LastVerdict(shown.id);
    study.CurrentVerdict(shown.id);
  }
  study.ProgressOf(rater, 1);
  study.NextOpen(rater, {}, 1);
  study.CurrentBy(rater);
  study.VerdictTableOf(rater);
}

/// Everything that a server, a board or an export asks for.
void ReadAll(const evac::StudyStore& study) {
  study.info();
  study.Id();
  study.Codec();
  study.Waves();
  study.Rubrics();
  study.Votes();
  for (const evac::StudyClip& clip : study.Clips()) study.CurrentOf(clip.id);
  for (const evac::StudyRater& rater : study.Raters()) ReadPerson(study, rater.id);
  study.Current();
  study.BallotsAfter(0);
  study.Disputes();
  study.UnplayableClips();
  study.Leases(1);
  study.Guesses();
  study.VerdictTable();
}

}  // namespace

/// Any bytes are a study's database, or an Error.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Scratch scratch;
  scratch.Write("study.sqlite", data, size);
  try {
    ReadAll(evac::StudyStore::Open(scratch.folder(), evac::StudyStore::Mode::kReadOnly));
  } catch (const evac::Error&) {
  }
  return 0;
}
