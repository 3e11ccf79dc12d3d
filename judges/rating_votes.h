#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/statistics/votes.h"
#include "core/store_study.h"

/// From votes to labels (docs/rating_session.md).
namespace evac {

/// What became of one clip.
struct Resolution {
  std::optional<Label> label;  ///< success or failure; nothing: it is not decided
  std::string how;             ///< adjudicated, majority; undecided: tie, too few votes, not rated
  Majority majority{};
};

/// @param adjudicated  an adjudicator's final word: success, failure or cannot_tell ("it cannot be told": not decided).
/// Otherwise the strict majority of successes and failures, of at least `wanted_valid` of them.
Resolution Resolve(const std::vector<Vote>& votes, const std::optional<std::string>& adjudicated,
                   std::int64_t wanted_valid);

struct RatedClip {
  StudyClip clip{};
  std::map<std::int64_t, StudyStore::Ballot> by_rater{};  ///< votes that count
  std::optional<std::string> adjudicated{};
  Resolution resolution{};
};
/// @param raters_per_clip  that the study wants.
Resolution ResolutionOf(const RatedClip& clip, int raters_per_clip);
/// Whether an adjudicator is asked for: all its votes are there and nobody decided, and they are split, too few could
/// tell, two of them have flags, or the majority is against what is known of the clip.
bool IsDisputed(const RatedClip& clip, int raters_per_clip);

/// The rates of some clips side by side; where they are far apart, a majority hides something.
struct LabelRates {
  std::int64_t clips = 0, decided = 0, undecided = 0;
  Number majority = Undefined{"no clip is decided"};                 ///< of the decided ones
  Number soft = Undefined{"no votes"};                               ///< mean share of success votes
  Number unanimous = Undefined{"no clip is unanimous"};              ///< of those where all agree
  Number dawid_skene = Undefined{"no votes"};                        ///< smoothing .5; where some clip has two votes
  Number low = Undefined{"no clips"}, high = Undefined{"no clips"};  ///< if all undecided were failures, successes
  bool far_apart = false;                                            ///< the first four differ by more than 3 points
};
LabelRates RatesOf(std::span<const RatedClip> clips);
LabelRates RatesOf(std::span<const RatedClip* const> clips);

struct RatingAgreement {
  Number alpha = Undefined{"no votes"};                ///< Krippendorff's, nominal, of success, failure and cannot tell
  Defined<Interval> interval = Undefined{"no votes"};  ///< of alpha, percentile bootstrap over clips
  std::int64_t dropped_replicates = 0;                 ///< of it, as their ratings are all equal
  Number fleiss = Undefined{"no votes"};               ///< of the clips that all have `raters_per_clip` votes
  Number agreement = Undefined{"no votes"};            ///< share of agreeing pairs of votes
  std::int64_t clips = 0;                              ///< with two votes or more
};
/// @param replicates  of the bootstrap; 0: no interval.
RatingAgreement RatersAgreement(const std::vector<RatedClip>& clips, int raters_per_clip, int replicates = 200);

/// What the lead should look at; nothing is ever dropped by itself.
struct RaterQuality {
  std::int64_t verdicts = 0;
  double success_share = 0;
  std::optional<double> median_rt_ms{};  ///< of those that were given here: imported ones have no time
  std::int64_t gold_right = 0, gold_seen = 0;
  std::int64_t repeats_same = 0, repeats_seen = 0;  ///< of clips that have both answers now
  std::vector<std::string> concerns{};  ///< sentences
};
/// @param ballots  the current ones of one rater, oldest first. @param clips  by id. @param period_s  of a frame.
RaterQuality QualityOfRater(const std::vector<StudyStore::Ballot>& ballots,
                            const std::unordered_map<std::int64_t, StudyClip>& clips, double period_s);

}  // namespace evac
