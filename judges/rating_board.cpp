#include "judges/rating_board.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <span>
#include <string_view>

#include "judges/rating_votes.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Number& number) {
  if (number) return {{"value", *number}};
  return {{"value", nullptr}, {"reason", number.reason()}};
}

std::string PublicName(std::int64_t rater) { return fmt::format("r{}", rater); }

Json ToJson(const LabelRates& rates) {
  return {{"clips", rates.clips},
          {"decided", rates.decided},
          {"undecided", rates.undecided},
          {"majority", ToJson(rates.majority)},
          {"soft", ToJson(rates.soft)},
          {"unanimous", ToJson(rates.unanimous)},
          {"dawid_skene", ToJson(rates.dawid_skene)},
          {"low", ToJson(rates.low)},
          {"high", ToJson(rates.high)},
          {"far_apart", rates.far_apart}};
}

Json AgreementJson(const std::vector<RatedClip>& clips, int raters_per_clip) {
  const RatingAgreement agreement = RatersAgreement(clips, raters_per_clip);
  Json json = {{"clips", agreement.clips},
               {"alpha", ToJson(agreement.alpha)},
               {"fleiss", ToJson(agreement.fleiss)},
               {"agreement", ToJson(agreement.agreement)}};
  if (agreement.interval)
    json["alpha"]["low"] = agreement.interval->low, json["alpha"]["high"] = agreement.interval->high;
  json["dropped_replicates"] = agreement.dropped_replicates;
  return json;
}

/// @param disputes  in ascending order, as `clips` are.
std::vector<const RatedClip*> DisputedFirst(const std::vector<RatedClip>& clips,
                                            const std::vector<std::int64_t>& disputes) {
  std::vector<const RatedClip*> ordered;
  ordered.reserve(clips.size());
  for (const RatedClip& rated : clips) ordered.push_back(&rated);
  std::ranges::stable_partition(
      ordered, [&](const RatedClip* rated) { return std::ranges::binary_search(disputes, rated->clip.id); });
  return ordered;
}

/// One row per clip: what the matrix shows.
Json ClipsJson(const std::vector<RatedClip>& clips, const std::vector<std::int64_t>& disputes,
               const BoardRows& wanted) {
  Json rows = Json::array();
  const std::vector<const RatedClip*> ordered = DisputedFirst(clips, disputes);
  const std::size_t from = std::min(wanted.from, ordered.size());
  for (const RatedClip* one : std::span(ordered).subspan(from, std::min(wanted.count, ordered.size() - from))) {
    const RatedClip& rated = *one;
    Json votes = Json::object();
    for (const auto& [rater, ballot] : rated.by_rater) votes[PublicName(rater)] = ballot.label;
    rows.push_back({{"clip", rated.clip.id},
                    {"episode", rated.clip.episode},
                    {"task", rated.clip.task},
                    {"world", rated.clip.world},
                    {"use", Name(rated.clip.use)},
                    {"votes", votes},
                    {"label", rated.resolution.label ? Json(Name(*rated.resolution.label)) : Json(nullptr)},
                    {"how", rated.resolution.how}});
  }
  return rows;
}

Json RatersJson(const StudyStore& store, const RatingTally& tally) {
  const double period_s = store.info().period_s;
  Json rows = Json::array();
  for (const StudyRater& rater : store.Raters()) {
    const RaterQuality quality = QualityOfRater(tally.By(rater.id), tally.clips(), period_s);
    rows.push_back({{"rater", PublicName(rater.id)},
                    {"name", rater.name},
                    {"role", Name(rater.role)},
                    {"status", rater.status},
                    {"counts", rater.counts},
                    {"verdicts", quality.verdicts},
                    {"success_share", quality.success_share},
                    {"median_rt_s", quality.median_rt_ms ? Json(*quality.median_rt_ms / 1000) : Json(nullptr)},
                    {"gold_right", quality.gold_right},
                    {"gold_seen", quality.gold_seen},
                    {"repeats_same", quality.repeats_same},
                    {"repeats_seen", quality.repeats_seen},
                    {"concerns", quality.concerns}});
  }
  return rows;
}

/// Bang's index per kind of world: did raters see which clips are generated?
Json BlindingJson(const StudyStore& store, const RatingTally& tally) {
  std::map<bool, BlindingGuesses> guesses;
  for (const StudyStore::Guess& guess : store.Guesses()) {
    const bool is_real = tally.clips().at(guess.clip).is_real;
    BlindingGuesses& of_world = guesses[is_real];
    if (guess.guess == "unsure")
      ++of_world.unsure;
    else if ((guess.guess == "real") == is_real)
      ++of_world.correct;
    else
      ++of_world.incorrect;
  }
  Json json = Json::object();
  for (const bool is_real : {true, false}) {
    const BlindingGuesses& given = guesses[is_real];
    const BlindingIndex index = BangBlindingIndex(given);
    json[is_real ? "real" : "generated"] = {{"index", ToJson(index.index)},
                                            {"se", ToJson(index.se)},
                                            {"guesses", given.correct + given.incorrect + given.unsure},
                                            {"is_seen_through", index.index && *index.index > 0.3}};
  }
  return json;
}

/// Votes of a clip that were missing and came since then: an imported one was no work, one too many fills no place.
std::int64_t FilledSince(const RatedClip& clip, std::int64_t from_ms, std::int64_t wanted) {
  const std::int64_t fresh = std::ranges::count_if(clip.by_rater, [from_ms](const auto& vote) {
    return vote.second.since_ms >= from_ms && vote.second.showing != Showing::kImport;
  });
  const std::int64_t others = static_cast<std::int64_t>(clip.by_rater.size()) - fresh;
  return std::min(fresh, std::max<std::int64_t>(0, wanted - others));
}

/// Clips, votes and what is left, with the time it takes if places are filled as in the last hour.
Json ProgressJson(const StudyStore& store, const std::vector<RatedClip>& clips, std::int64_t now_ms) {
  const std::int64_t wanted = store.info().raters_per_clip;
  std::int64_t votes = 0, complete = 0, missing = 0, last_hour = 0;
  for (const RatedClip& clip : clips) {
    const auto given = static_cast<std::int64_t>(clip.by_rater.size());
    votes += given;
    if (given >= wanted) ++complete;
    missing += std::max<std::int64_t>(0, wanted - given);
    last_hour += FilledSince(clip, now_ms - 3'600'000, wanted);
  }
  Json json = {{"clips", clips.size()},
               {"complete", complete},
               {"votes", votes},
               {"missing", missing},
               {"last_hour", last_hour}};
  json["hours_left"] =
      last_hour > 0 ? Json(static_cast<double>(missing) / static_cast<double>(last_hour)) : Json(nullptr);
  return json;
}

std::map<std::string, std::string> VersionsByHash(const StudyStore& store) {
  std::map<std::string, std::string> versions;
  for (const StudyRubric& rubric : store.Rubrics())
    versions[rubric.hash] = Json::parse(rubric.document).value("version", "");
  return versions;
}

/// By task, world and rubric: verdicts by different rubrics are in no rate together.
Json RatesJson(const StudyStore& store, const std::vector<RatedClip>& clips) {
  const std::map<std::string, std::string> versions = VersionsByHash(store);
  std::map<std::array<std::string_view, 4>, std::vector<const RatedClip*>> groups;
  for (const RatedClip& rated : clips) {
    const StudyClip& clip = rated.clip;
    groups[{clip.task, clip.world, versions.at(clip.rubric_hash), clip.rubric_hash}].push_back(&rated);
  }
  Json rates = Json::array();
  for (const auto& [name, group] : groups) {
    Json row = ToJson(RatesOf(group));
    row["task"] = name[0];
    row["world"] = name[1];
    row["rubric"] = name[2];
    rates.push_back(std::move(row));
  }
  return rates;
}

}  // namespace

Json RatingBoard(const StudyStore& store, std::int64_t now_ms, const BoardRows& wanted) {
  RatingTally tally;
  return RatingBoard(store, tally, now_ms, wanted);
}

Json RatingBoard(const StudyStore& store, RatingTally& tally, std::int64_t now_ms, const BoardRows& wanted) {
  tally.Read(store);
  const StudyInfo info = store.info();
  const std::vector<RatedClip>& clips = tally.rated();
  const std::vector<std::int64_t> disputes = tally.Disputes();
  Json leases = Json::array(), unplayable = Json::array();
  for (const Presentation& lease : store.Leases(now_ms))
    leases.push_back(
        {{"rater", PublicName(lease.rater)}, {"clip", lease.clip}, {"left_s", (lease.lease_until_ms - now_ms) / 1000}});
  for (const StudyStore::Unplayable& one : store.UnplayableClips())
    unplayable.push_back({{"rater", PublicName(one.rater)},
                          {"clip", one.clip},
                          {"episode", tally.clips().at(one.clip).episode},
                          {"reason", one.reason}});
  std::int64_t excluded = 0;
  for (const StudyRater& rater : store.Raters()) excluded += rater.counts ? 0 : 1;
  return {{"study", info.name},
          {"raters_per_clip", info.raters_per_clip},
          {"progress", ProgressJson(store, clips, now_ms)},
          {"raters_excluded", excluded},
          {"all", ToJson(RatesOf(clips))},
          {"rates", RatesJson(store, clips)},
          {"agreement", AgreementJson(clips, info.raters_per_clip)},
          {"blinding", BlindingJson(store, tally)},
          {"raters", RatersJson(store, tally)},
          {"disputes", disputes},
          {"leases", leases},
          {"unplayable", unplayable},
          {"clips_from", wanted.from},
          {"clips", ClipsJson(clips, disputes, wanted)}};
}

}  // namespace evac
