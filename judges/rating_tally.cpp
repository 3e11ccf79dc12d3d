#include "judges/rating_tally.h"

#include <algorithm>
#include <utility>

namespace evac {
namespace {

std::set<std::int64_t> WhoDoesNotCount(const StudyStore& store) {
  std::set<std::int64_t> raters;
  for (const StudyRater& rater : store.Raters()) {
    if (!rater.counts) raters.insert(rater.id);
  }
  return raters;
}

}  // namespace

void RatingTally::Read(const StudyStore& store) {
  if (const int waves = store.Waves(); waves != waves_) Begin(store, waves);
  if (std::set<std::int64_t> left_out = WhoDoesNotCount(store); left_out != left_out_) {
    left_out_ = std::move(left_out);
    CountAnew();
  }
  for (StudyStore::Ballot& ballot : store.BallotsAfter(last_)) Take(std::move(ballot));
}

const std::vector<StudyStore::Ballot>& RatingTally::By(std::int64_t rater) const {
  static const std::vector<StudyStore::Ballot> nothing;
  const auto found = by_rater_.find(rater);
  return found == by_rater_.end() ? nothing : found->second;
}

std::vector<std::int64_t> RatingTally::Disputes() const {
  std::vector<std::int64_t> disputes;
  for (const RatedClip& rated : rated_) {
    if (IsDisputed(rated, raters_per_clip_)) disputes.push_back(rated.clip.id);
  }
  return disputes;
}

void RatingTally::Begin(const StudyStore& store, int waves) {
  *this = RatingTally();
  store.RequireWhole();  // votes of a rater who is missing would be counted as none
  raters_per_clip_ = store.info().raters_per_clip;
  for (StudyClip& clip : store.Clips()) {
    if (clip.use != Showing::kPractice && clip.use != Showing::kExample) {
      place_[clip.id] = rated_.size();
      RatedClip& rated = rated_.emplace_back();
      rated.clip = clip;
      rated.resolution = ResolutionOf(rated, raters_per_clip_);
    }
    const std::int64_t id = clip.id;
    clips_.emplace(id, std::move(clip));
  }
  waves_ = waves;
}

/// What is replaced goes; what says something comes.
void RatingTally::Take(StudyStore::Ballot ballot) {
  last_ = ballot.id;
  std::vector<StudyStore::Ballot>& own = by_rater_[ballot.rater];
  if (ballot.supersedes != 0) {
    const auto replaced = std::find_if(own.rbegin(), own.rend(),
                                       [&](const StudyStore::Ballot& said) { return said.id == ballot.supersedes; });
    if (replaced != own.rend()) {  // a "retracted" row was taken away when it came
      ballot.since_ms = replaced->since_ms;
      ballot.rt_ms = std::max(ballot.rt_ms, replaced->rt_ms);  // who corrects an answer has seen the clip before
      ballot.max_speed = std::max(ballot.max_speed, replaced->max_speed);
      Discount(*replaced);
      own.erase(std::next(replaced).base());
    }
  }
  if (ballot.label == "retracted") return;
  Count(ballot);
  own.push_back(std::move(ballot));
}

void RatingTally::Count(const StudyStore::Ballot& ballot) {
  RatedClip* rated = RatedOf(ballot.clip);
  if (!rated || left_out_.contains(ballot.rater)) return;
  if (ballot.showing == Showing::kRepeat || ballot.showing == Showing::kPractice) return;
  if (ballot.showing != Showing::kAdjudication) {
    rated->by_rater[ballot.rater] = ballot;
  } else if (ballot.is_final) {
    decisions_[ballot.clip][ballot.id] = ballot.label;
    rated->adjudicated = decisions_[ballot.clip].rbegin()->second;
  }
  rated->resolution = ResolutionOf(*rated, raters_per_clip_);
}

void RatingTally::Discount(const StudyStore::Ballot& ballot) {
  RatedClip* rated = RatedOf(ballot.clip);
  if (!rated || left_out_.contains(ballot.rater)) return;
  if (ballot.showing == Showing::kRepeat || ballot.showing == Showing::kPractice) return;
  if (ballot.showing != Showing::kAdjudication) {
    rated->by_rater.erase(ballot.rater);
  } else if (ballot.is_final) {
    auto& decisions = decisions_[ballot.clip];
    decisions.erase(ballot.id);
    rated->adjudicated.reset();
    if (!decisions.empty()) rated->adjudicated = decisions.rbegin()->second;
  }
  rated->resolution = ResolutionOf(*rated, raters_per_clip_);
}

/// Somebody left the study, or came back into it.
void RatingTally::CountAnew() {
  decisions_.clear();
  for (RatedClip& rated : rated_) {
    rated.by_rater.clear();
    rated.adjudicated.reset();
    rated.resolution = ResolutionOf(rated, raters_per_clip_);
  }
  for (const auto& [rater, said] : by_rater_) {
    for (const StudyStore::Ballot& ballot : said) Count(ballot);
  }
}

RatedClip* RatingTally::RatedOf(std::int64_t clip) {
  const auto found = place_.find(clip);
  return found == place_.end() ? nullptr : &rated_[found->second];
}

}  // namespace evac
