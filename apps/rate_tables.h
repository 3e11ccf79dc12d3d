#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/store_study.h"

/// A study's verdicts as tables (docs/rating_session.md).
namespace evac {

/// Every verdict with every stored field: RFC 4180, a header, LF.
std::string RatingCsv(const StudyTable& table);
/// The same, a JSON object a line; numbers are numbers, empty cells null.
std::string RatingJsonLines(const StudyTable& table);

/// One row of a lab's own sheet.
struct ImportedVerdict {
  int line = 0;
  std::int64_t clip = 0;
  std::string rater;
  std::string label;  ///< success, failure, cannot_tell
  std::string note;
};

/// Reads columns episode, rater, label (success, failure, cannot_tell, or S, F, U, 1, 0), and if they are there run and
/// note; other columns are not looked at.
/// @param file  what messages call the text.
/// @throws InvalidInput naming every wrong line (at most 20): an episode that is not in the study or in two runs of it,
/// another label, a rater without a name, the same rater twice for one clip. Nothing is read in part.
std::vector<ImportedVerdict> ReadRatingCsv(std::string_view text, const std::string& file,
                                           const std::vector<StudyClip>& clips);

/// How many of them are of examples and practice clips: they are kept, and no rate counts them.
std::int64_t UncountedIn(const std::vector<ImportedVerdict>& verdicts, const std::vector<StudyClip>& clips);

/// Adds them, all or none, as verdicts of raters of those names. A verdict that is there already is left alone.
/// @returns how many are new. @throws InvalidInput if one is there with another label.
int ImportVerdicts(StudyStore& store, const std::vector<ImportedVerdict>& verdicts, const std::string& file,
                   std::int64_t now_ms, const std::string& app_version);

}  // namespace evac
