#include "judges/rating_votes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "core/seed.h"
#include "core/statistics/bootstrap.h"
#include "core/statistics/dawid_skene.h"
#include "core/statistics/rater_agreement.h"

namespace evac {
namespace {

Vote VoteOf(const std::string& label) {
  return label == "success" ? Vote::kSuccess : label == "failure" ? Vote::kFailure : Vote::kUnsure;
}

std::vector<Vote> VotesOf(const RatedClip& clip) {
  std::vector<Vote> votes;
  for (const auto& [rater, ballot] : clip.by_rater) votes.push_back(VoteOf(ballot.label));
  return votes;
}

std::size_t CategoryOf(const std::string& label) { return label == "success" ? 1 : label == "failure" ? 0 : 2; }

Number DawidSkeneRate(std::span<const RatedClip* const> clips) {
  std::map<std::int64_t, std::vector<RaterCounts::Said>> said;
  for (std::size_t i = 0; i < clips.size(); ++i) {
    for (const auto& [rater, ballot] : clips[i]->by_rater) {
      std::vector<RaterCounts::Said>& of_rater = said[rater];
      const std::size_t category = CategoryOf(ballot.label);
      if (category < 2) of_rater.push_back({static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(category)});
    }
  }
  std::int64_t most_votes = 0;
  for (const RatedClip* clip : clips) most_votes = std::max(most_votes, clip->resolution.majority.valid);
  if (most_votes == 0) return Undefined{"no votes"};
  if (most_votes == 1) return Undefined{"no clip has two votes"};  // of one each, no rater can be told from chance
  RaterCounts counts{.items = static_cast<Eigen::Index>(clips.size()), .labels = 2};
  for (auto& [rater, of_rater] : said) counts.of_rater.push_back(std::move(of_rater));
  const DawidSkene fit = FitDawidSkene(counts, {.smoothing = 0.5, .max_iterations = 200, .tolerance = 1e-6});
  double rate = 0;
  std::int64_t with_votes = 0;
  for (std::size_t i = 0; i < clips.size(); ++i) {
    if (clips[i]->resolution.majority.valid == 0) continue;
    rate += fit.posterior(static_cast<Eigen::Index>(i), 1);
    ++with_votes;
  }
  return rate / static_cast<double>(with_votes);
}

Number Share(std::int64_t part, std::int64_t whole, const char* reason) {
  if (whole == 0) return Undefined{reason};
  return static_cast<double>(part) / static_cast<double>(whole);
}

/// Krippendorff's nominal alpha needs sums of pairs alone: counted by clip once, resampled quickly.
struct Pairs {
  std::array<double, 3> n{};        // ratings of each category, in clips with two or more
  double different = 0, total = 0;  // weighted pairs that differ within clips; ratings

  Pairs& operator+=(const Pairs& other) {
    for (std::size_t c = 0; c < n.size(); ++c) n[c] += other.n[c];
    different += other.different;
    total += other.total;
    return *this;
  }
};

Pairs PairsOf(const RatedClip& clip) {
  Pairs pairs;
  for (const auto& [rater, ballot] : clip.by_rater) pairs.n[CategoryOf(ballot.label)] += 1;
  const double m = pairs.n[0] + pairs.n[1] + pairs.n[2];
  if (m < 2) return {};
  pairs.total = m;
  for (const double n : pairs.n) pairs.different += n * (m - n) / (m - 1);
  return pairs;
}

std::optional<double> AlphaOf(const Pairs& sum) {
  double expected = 0;
  for (const double n : sum.n) expected += n * (sum.total - n);
  if (sum.total < 2 || expected == 0) return std::nullopt;
  return 1 - sum.different * (sum.total - 1) / expected;
}

/// @param dropped  replicates whose ratings are all equal
Defined<Interval> AlphaInterval(const std::vector<Pairs>& pairs, double alpha, int replicates, std::int64_t& dropped) {
  if (pairs.size() < 2 || replicates == 0) return Undefined{"too few clips"};
  SplitMix64 draws(0);
  Resampled resampled{alpha, {}, {}};
  for (int b = 0; b < replicates; ++b) {
    Pairs sum;
    for (std::size_t i = 0; i < pairs.size(); ++i) sum += pairs[draws.Below(pairs.size())];
    if (const auto drawn_alpha = AlphaOf(sum)) {
      resampled.replicates.push_back(*drawn_alpha);
    } else {
      ++dropped;
    }
  }
  return IntervalsOf(resampled).percentile;
}

std::optional<double> Median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::ranges::sort(values);
  return Quantile(values, 0.5);
}

/// What a rater says of each clip at its first showing. It may come after the repeat's answer: it was changed then.
std::unordered_map<std::int64_t, std::string_view> FirstAnswers(const std::vector<StudyStore::Ballot>& ballots) {
  std::unordered_map<std::int64_t, std::string_view> first;
  for (const StudyStore::Ballot& ballot : ballots) {
    if (ballot.showing != Showing::kRepeat) first[ballot.clip] = ballot.label;
  }
  return first;
}

/// A verdict that came before anybody could have seen the clip.
bool IsTooFast(const StudyStore::Ballot& ballot, const StudyClip& clip, double period_s) {
  if (ballot.showing == Showing::kImport) return false;
  const double clip_ms = 1e3 * clip.frames * period_s / std::max(1.0, ballot.max_speed);
  return ballot.rt_ms < std::max(1200.0, 0.25 * clip_ms);
}

}  // namespace

Resolution Resolve(const std::vector<Vote>& votes, const std::optional<std::string>& adjudicated,
                   std::int64_t wanted_valid) {
  Resolution resolution;
  resolution.majority = MajorityOf(votes);
  if (adjudicated) {
    resolution.how = "adjudicated";
    if (*adjudicated == "success") resolution.label = Label::kSuccess;
    if (*adjudicated == "failure") resolution.label = Label::kFailure;
    return resolution;
  }
  if (votes.empty()) {
    resolution.how = "not rated";
  } else if (resolution.majority.valid < wanted_valid) {
    resolution.how = "too few votes";
  } else if (!resolution.majority.success) {
    resolution.how = "tie";
  } else {
    resolution.how = "majority";
    resolution.label = *resolution.majority.success ? Label::kSuccess : Label::kFailure;
  }
  return resolution;
}

Resolution ResolutionOf(const RatedClip& clip, int raters_per_clip) {
  return Resolve(VotesOf(clip), clip.adjudicated, std::min(2, raters_per_clip));
}

bool IsDisputed(const RatedClip& clip, int raters_per_clip) {
  if (static_cast<int>(clip.by_rater.size()) < raters_per_clip || clip.adjudicated) return false;
  const std::int64_t successes = clip.resolution.majority.successes;
  const std::int64_t failures = clip.resolution.majority.valid - successes;
  const auto with_flags = std::ranges::count_if(clip.by_rater, [](const auto& vote) { return vote.second.has_flags; });
  const std::optional<Label>& known = clip.clip.reference;
  return (successes > 0 && failures > 0) || successes + failures < std::min(2, raters_per_clip) || with_flags >= 2 ||
         (known == Label::kFailure && successes > failures) || (known == Label::kSuccess && failures > successes);
}

LabelRates RatesOf(std::span<const RatedClip> clips) {
  std::vector<const RatedClip*> all;
  all.reserve(clips.size());
  for (const RatedClip& clip : clips) all.push_back(&clip);
  return RatesOf(all);
}

LabelRates RatesOf(std::span<const RatedClip* const> clips) {
  LabelRates rates;
  std::int64_t successes = 0, unanimous = 0, unanimous_successes = 0, with_votes = 0;
  double soft = 0;
  for (const RatedClip* clip : clips) {
    const Majority& majority = clip->resolution.majority;
    ++rates.clips;
    if (clip->resolution.label) ++rates.decided;
    if (clip->resolution.label == Label::kSuccess) ++successes;
    if (majority.valid == 0) continue;
    soft += *majority.soft;
    ++with_votes;
    if (majority.split || majority.unsure > 0) continue;
    ++unanimous;
    if (majority.successes > 0) ++unanimous_successes;
  }
  rates.undecided = rates.clips - rates.decided;
  rates.majority = Share(successes, rates.decided, "no clip is decided");
  rates.unanimous = Share(unanimous_successes, unanimous, "no clip is unanimous");
  if (with_votes > 0) rates.soft = soft / static_cast<double>(with_votes);
  rates.dawid_skene = DawidSkeneRate(clips);
  rates.low = Share(successes, rates.clips, "no clips");
  rates.high = Share(successes + rates.undecided, rates.clips, "no clips");
  double least = 1, most = 0;
  for (const Number& rate : {rates.majority, rates.soft, rates.unanimous, rates.dawid_skene}) {
    if (rate) least = std::min(least, *rate), most = std::max(most, *rate);
  }
  rates.far_apart = most - least > 0.03;
  return rates;
}

RatingAgreement RatersAgreement(const std::vector<RatedClip>& clips, int raters_per_clip, int replicates) {
  RatingAgreement result;
  std::vector<std::vector<std::int64_t>> counts;
  std::vector<Pairs> by_clip;
  Pairs sum;
  double agreeing = 0, pairs = 0;
  for (const RatedClip& clip : clips) {
    if (clip.by_rater.size() < 2) continue;
    ++result.clips;
    sum += by_clip.emplace_back(PairsOf(clip));
    std::vector<std::int64_t> of_clip(3);
    for (const auto& [rater, ballot] : clip.by_rater) ++of_clip[CategoryOf(ballot.label)];
    const auto m = static_cast<double>(clip.by_rater.size());
    for (const std::int64_t n : of_clip) agreeing += static_cast<double>(n * (n - 1)) / 2;
    pairs += m * (m - 1) / 2;
    if (static_cast<int>(clip.by_rater.size()) == raters_per_clip) counts.push_back(std::move(of_clip));
  }
  if (result.clips == 0) return result;
  if (const auto alpha = AlphaOf(sum)) {
    result.alpha = *alpha;
    result.interval = AlphaInterval(by_clip, *alpha, replicates, result.dropped_replicates);
  } else {
    result.alpha = Undefined{"all ratings are equal"};
  }
  result.agreement = agreeing / pairs;
  if (!counts.empty()) result.fleiss = FleissKappaOf(counts).kappa;
  return result;
}

RaterQuality QualityOfRater(const std::vector<StudyStore::Ballot>& ballots,
                            const std::unordered_map<std::int64_t, StudyClip>& clips, double period_s) {
  RaterQuality quality;
  std::int64_t successes = 0, too_fast = 0;
  const std::string* answer = nullptr;
  bool is_one_answer = true;
  const std::unordered_map<std::int64_t, std::string_view> first = FirstAnswers(ballots);
  std::vector<double> rt_ms;
  for (const StudyStore::Ballot& ballot : ballots) {
    const StudyClip& clip = clips.at(ballot.clip);
    if (ballot.showing == Showing::kPractice) continue;
    if (const auto said = first.find(ballot.clip); ballot.showing == Showing::kRepeat && said != first.end()) {
      ++quality.repeats_seen;
      if (said->second == ballot.label) ++quality.repeats_same;
    }
    if (ballot.showing == Showing::kGold && clip.reference) {
      ++quality.gold_seen;
      if (ballot.label == Name(*clip.reference)) ++quality.gold_right;
    }
    ++quality.verdicts;
    if (!answer) answer = &ballot.label;
    if (*answer != ballot.label) is_one_answer = false;
    if (ballot.label == "success") ++successes;
    if (IsTooFast(ballot, clip, period_s)) ++too_fast;
    if (ballot.showing != Showing::kImport) rt_ms.push_back(ballot.rt_ms);
  }
  if (quality.verdicts == 0) return quality;
  quality.success_share = static_cast<double>(successes) / static_cast<double>(quality.verdicts);
  quality.median_rt_ms = Median(std::move(rt_ms));
  if (too_fast * 20 >= quality.verdicts)
    quality.concerns.push_back(
        fmt::format("{} of {} verdicts came too fast to have seen the clip", too_fast, quality.verdicts));
  if (quality.verdicts >= 30 && is_one_answer)
    quality.concerns.push_back(fmt::format("all {} verdicts are {}", quality.verdicts, *answer));
  if (quality.gold_seen >= 12 && quality.gold_right * 12 < quality.gold_seen * 10)
    quality.concerns.push_back(fmt::format("{} of {} known clips right", quality.gold_right, quality.gold_seen));
  return quality;
}

}  // namespace evac
