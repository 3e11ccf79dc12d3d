#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/store_study.h"
#include "judges/rating_votes.h"

namespace evac {

/// A study's votes by clip and by rater. Verdicts are never changed, so that the first Read reads all of them and every
/// later one only what was said since: a board over 10^5 verdicts costs what is new.
class RatingTally {
 public:
  /// Of the study as it is now. Clips that were added make it read all anew. Always the same study.
  /// @throws InvalidInput if it is damaged (StudyStore::RequireWhole).
  void Read(const StudyStore& store);

  /// Every clip of the study but practice and examples, in its order, with the votes that count.
  const std::vector<RatedClip>& rated() const { return rated_; }
  /// Every clip, by id.
  const std::unordered_map<std::int64_t, StudyClip>& clips() const { return clips_; }
  /// What a rater says now, counted or not, oldest first. What replaced something is since when that was said,
  /// with its time and speed if they are greater.
  const std::vector<StudyStore::Ballot>& By(std::int64_t rater) const;
  /// Ids of clips that an adjudicator is asked for, ascending: what StudyStore::Disputes finds.
  std::vector<std::int64_t> Disputes() const;

 private:
  void Begin(const StudyStore& store, int waves);
  void Take(StudyStore::Ballot ballot);
  void Count(const StudyStore::Ballot& ballot);
  void Discount(const StudyStore::Ballot& ballot);
  void CountAnew();
  RatedClip* RatedOf(std::int64_t clip);

  int raters_per_clip_ = 0, waves_ = 0;
  std::int64_t last_ = 0;                                             // verdict that was read
  std::set<std::int64_t> left_out_;                                   // raters who do not count
  std::unordered_map<std::int64_t, StudyClip> clips_;                 // by id
  std::map<std::int64_t, std::vector<StudyStore::Ballot>> by_rater_;  // what each says now
  std::vector<RatedClip> rated_;
  std::unordered_map<std::int64_t, std::size_t> place_;  // of a clip in rated_
  // Final words by clip and verdict: the last one holds, and another one if it is taken back.
  std::unordered_map<std::int64_t, std::map<std::int64_t, std::string>> decisions_;
};

}  // namespace evac
