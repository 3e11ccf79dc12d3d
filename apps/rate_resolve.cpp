#include "apps/rate_resolve.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/store.h"
#include "judges/rating_tally.h"
#include "reports/wording.h"

namespace evac {
namespace {

struct RubricFacts {
  std::string version;
  std::vector<std::string> stages;
};

std::map<std::string, RubricFacts> FactsOf(const StudyStore& study) {
  std::map<std::string, RubricFacts> facts;
  for (const StudyRubric& rubric : study.Rubrics()) {
    const auto document = nlohmann::json::parse(rubric.document);
    RubricFacts& of_rubric = facts[rubric.hash];
    of_rubric.version = document.value("version", "");
    for (const auto& stage : document.value("stages", nlohmann::json::array()))
      of_rubric.stages.push_back(stage.value("name", ""));
  }
  return facts;
}

/// Raters by clip who ever voted there, whether it counts now or not.
using Voters = std::map<std::int64_t, std::set<std::int64_t>>;

Voters VotersOf(const StudyStore& study) {
  Voters voters;
  for (const StudyStore::Ballot& ballot : study.BallotsAfter(0)) {
    const bool is_vote = ballot.showing == Showing::kCounted || ballot.showing == Showing::kGold ||
                         ballot.showing == Showing::kImport;
    if (is_vote) voters[ballot.clip].insert(ballot.rater);
  }
  return voters;
}

/// The last verdict of a name counts: under another judge's name people's labels would stand for what that one said.
/// `human:…` is a single rater everywhere: a panel's label of such a name would be one more vote.
void CheckName(const std::string& judge) {
  const std::string first = judge.substr(0, judge.find(':'));
  const bool is_taken = first == "oracle" || first == "vlm" || first == "classifier";
  if (first.empty() || is_taken || judge.find(',') != std::string::npos)
    throw InvalidInput("--as: found '{}', wanted a name without commas that is none of oracle, vlm and classifier", judge);
  if (judge.starts_with("human:"))
    throw InvalidInput("--as: found '{}', wanted one that does not begin with 'human:', as single raters' names do",
                       judge);
}

bool HasSomebodysWord(const RatedClip& clip) { return !clip.by_rater.empty() || clip.adjudicated; }

void CheckRubrics(const std::vector<RatedClip>& clips) {
  std::map<std::string, std::set<std::string>> by_task;
  for (const RatedClip& clip : clips) {
    if (HasSomebodysWord(clip)) by_task[clip.clip.task].insert(clip.clip.rubric_hash);
  }
  for (const auto& [task, hashes] : by_task) {
    if (hashes.size() > 1)
      throw InvalidInput("task {}: was rated by {} rubrics; --mix-rubrics makes one judge of them", task,
                         hashes.size());
  }
}

/// No stage marked is something said by who saw a failure, of a clip that is one. Sheets have no stages, and who saw a
/// success without marking any has left them out.
bool TellsStages(const StudyStore::Ballot& ballot, std::optional<Label> label) {
  if (ballot.stages != 0) return true;
  return ballot.showing != Showing::kImport && ballot.label == "failure" && label != Label::kSuccess;
}

/// A stage counts as reached if more than half of those say so who tell of stages; nothing if nobody does.
std::map<std::string, bool> StagesOf(const std::vector<StudyStore::Ballot>& ballots, std::optional<Label> label,
                                     const RubricFacts& facts) {
  std::map<std::string, bool> stages;
  const auto telling =
      std::ranges::count_if(ballots, [&](const StudyStore::Ballot& ballot) { return TellsStages(ballot, label); });
  if (telling == 0) return stages;
  for (std::size_t k = 0; k < facts.stages.size(); ++k) {
    const auto reached = std::ranges::count_if(
        ballots, [k](const StudyStore::Ballot& ballot) { return (ballot.stages >> k & 1) != 0; });
    stages[facts.stages[k]] = 2 * reached > telling;
  }
  return stages;
}

/// What a study is told from others by: two may have one name.
struct WhichStudy {
  std::string name, id;
};

/// At the end of a reason: whose it is.
std::string Signature(const WhichStudy& study) { return fmt::format(" (study {}, id {})", study.name, study.id); }

/// Earlier versions signed with the name alone: such a verdict is taken for this study's if the name is.
bool IsOfAnotherStudy(const Verdict& verdict, const WhichStudy& study) {
  const std::string& reason = verdict.reason;
  const bool is_ours = reason.ends_with(Signature(study)) || reason.ends_with(fmt::format(" (study {})", study.name));
  return reason.find(" (study ") != std::string::npos && !is_ours;
}

std::string ReasonOf(const RatedClip& clip, const WhichStudy& study) {
  const Majority& majority = clip.resolution.majority;
  return fmt::format("{}: {} success, {} failure, {} cannot tell{}", clip.resolution.how, majority.successes,
                     majority.valid - majority.successes, majority.unsure, Signature(study));
}

/// What a run is to say of one clip.
struct Told {
  Verdict verdict;
  bool takes_back = false;  ///< only where the run says something by that judge: it was of votes that are gone
  std::string source_sha256 = {};  ///< of the episode's video that raters saw
};

/// Gives the verdicts of one study, under the names that they have in runs.
class Speaker {
 public:
  Speaker(const StudyStore& study, const ResolveOptions& options)
      : study_{study.info().name, study.Id()}, options_(options), facts_(FactsOf(study)), voters_(VotersOf(study)) {}

  std::vector<Told> AllOf(const RatedClip& clip) const {
    std::vector<Told> told;
    const auto voters = voters_.find(clip.clip.id);
    if (HasSomebodysWord(clip)) {
      told.push_back({LabelOf(clip)});
    } else if (voters != voters_.end()) {
      told.push_back(TakenBack(clip, options_.judge));
    }
    if (options_.each_rater) {
      for (const auto& [rater, ballot] : clip.by_rater) told.push_back({VoteOf(clip, ballot)});
    }
    if (voters == voters_.end()) return told;
    for (const std::int64_t rater : voters->second) {
      if (!clip.by_rater.contains(rater)) told.push_back(TakenBack(clip, NameOf(rater)));
    }
    return told;
  }

 private:
  std::string NameOf(std::int64_t rater) const { return fmt::format("human:{}:r{}", study_.name, rater); }

  Verdict Begun(const RatedClip& clip, const std::string& judge) const {
    Verdict verdict;
    verdict.episode_id = clip.clip.episode;
    verdict.judge = judge;
    verdict.rubric_version = facts_.at(clip.clip.rubric_hash).version;
    return verdict;
  }

  Verdict LabelOf(const RatedClip& clip) const {
    std::vector<StudyStore::Ballot> ballots;
    for (const auto& [rater, ballot] : clip.by_rater) ballots.push_back(ballot);
    Verdict verdict = Begun(clip, options_.judge);
    verdict.label = clip.resolution.label.value_or(Label::kCannotTell);
    if (clip.resolution.majority.soft) verdict.probability = *clip.resolution.majority.soft;
    verdict.stages = StagesOf(ballots, clip.resolution.label, facts_.at(clip.clip.rubric_hash));
    verdict.reason = ReasonOf(clip, study_);
    return verdict;
  }

  Verdict VoteOf(const RatedClip& clip, const StudyStore::Ballot& ballot) const {
    Verdict verdict = Begun(clip, NameOf(ballot.rater));
    verdict.label = LabelFromName(ballot.label);
    verdict.stages = StagesOf({ballot}, verdict.label, facts_.at(clip.clip.rubric_hash));
    verdict.reason = "a single vote" + Signature(study_);
    return verdict;
  }

  /// Verdicts are never removed: one that says nothing takes the old one's place.
  Told TakenBack(const RatedClip& clip, const std::string& judge) const {
    Told told{Begun(clip, judge), true};
    told.verdict.label = Label::kCannotTell;
    told.verdict.reason = "no vote counts";
    return told;
  }

  WhichStudy study_;
  const ResolveOptions& options_;
  std::map<std::string, RubricFacts> facts_;
  Voters voters_;
};

bool IsSame(const Verdict& a, const Verdict& b) {
  return a.label == b.label && a.reason == b.reason && a.stages == b.stages && a.rubric_version == b.rubric_version;
}

struct New {
  std::vector<Verdict> verdicts;
  std::int64_t of_other_studies = 0;  ///< those among them that take another study's place
};

/// What raters saw is what is there: a run that was made anew has the same episode ids.
void RequireSameVideo(const Store& store, const std::map<std::string, std::string>& videos, const Told& told) {
  const auto found = videos.find(told.verdict.episode_id);
  if (found == videos.end())
    throw InvalidInput("{}: has no episode {} any more, which raters were shown; wanted the run as it was",
                       store.folder().string(), told.verdict.episode_id);
  if (found->second != told.source_sha256)
    throw InvalidInput("{}: the video of episode {} is another than raters were shown: SHA-256 {}, in the study {}; "
                       "wanted the run as it was",
                       store.folder().string(), told.verdict.episode_id, found->second, told.source_sha256);
}

/// r1 of one study is not r1 of another: under the name that both have, one person would say what the other one said.
void RequireOwnRater(const Store& store, const Verdict& there, const WhichStudy& study) {
  if (!there.judge.starts_with("human:")) return;
  throw InvalidInput("{}: the vote of {} on episode {} is of another study that is named '{}' too; wanted a study of "
                     "another name (evac rate new --name), or this one without --each-rater",
                     store.folder().string(), there.judge, there.episode_id, study.name);
}

/// What a run does not say yet. A study takes back what it said itself only.
/// @throws InvalidInput if an episode is not the one that raters saw, or a rater's name is another study's
New NewFor(const Store& store, const std::vector<Told>& all, const WhichStudy& study) {
  const auto current = store.CurrentVerdicts();
  std::map<std::string, std::string> videos;
  for (const Episode& episode : store.Episodes()) videos[episode.key.Id()] = episode.video_sha256;
  New fresh;
  for (const Told& told : all) {
    const Verdict& verdict = told.verdict;
    const auto of_episode = current.find(verdict.episode_id);
    const bool is_known = of_episode != current.end() && of_episode->second.contains(verdict.judge);
    const bool is_anothers = is_known && IsOfAnotherStudy(of_episode->second.at(verdict.judge), study);
    if (told.takes_back && (!is_known || is_anothers)) continue;
    RequireSameVideo(store, videos, told);
    if (is_anothers) RequireOwnRater(store, of_episode->second.at(verdict.judge), study);
    if (is_known && IsSame(of_episode->second.at(verdict.judge), verdict)) continue;
    fresh.verdicts.push_back(verdict);
    fresh.of_other_studies += is_anothers;
  }
  return fresh;
}

}  // namespace

Resolved ResolveStudy(const StudyStore& study, const ResolveOptions& options) {
  CheckName(options.judge);
  RatingTally tally;
  tally.Read(study);
  const std::vector<RatedClip>& clips = tally.rated();
  if (!options.mix_rubrics) CheckRubrics(clips);
  const Speaker speaker(study, options);
  Resolved resolved;
  std::map<std::string, std::vector<Told>> by_run;
  for (const RatedClip& clip : clips) {
    if (HasSomebodysWord(clip)) ++(clip.resolution.label ? resolved.decided : resolved.undecided);
    for (Told& told : speaker.AllOf(clip)) {
      told.source_sha256 = clip.clip.source_sha256;
      by_run[clip.clip.run].push_back(std::move(told));
    }
  }
  resolved.unlabelled = std::ssize(tally.clips()) - std::ssize(clips);
  const WhichStudy which{study.info().name, study.Id()};
  // Before any is written.
  for (const auto& [run, all] : by_run) NewFor(Store::Open(run, Store::Mode::kReadOnly), all, which);
  std::int64_t of_other_studies = 0;
  for (const auto& [run, all] : by_run) {
    Store store = Store::Open(run, Store::Mode::kReadWrite);
    const New fresh = NewFor(store, all, which);
    store.AddVerdicts(fresh.verdicts);
    resolved.written += std::ssize(fresh.verdicts);
    of_other_studies += fresh.of_other_studies;
  }
  if (of_other_studies > 0)
    resolved.warnings.push_back(fmt::format("{} of judge {} instead of another study's (--as NAME keeps studies apart)",
                                            Counted(of_other_studies, "label"), options.judge));
  std::int64_t excluded = 0;
  for (const StudyRater& rater : study.Raters()) excluded += rater.counts ? 0 : 1;
  if (excluded > 0) resolved.warnings.push_back(fmt::format("{} raters excluded", excluded));
  const LabelRates rates = RatesOf(clips);
  if (rates.far_apart)
    resolved.warnings.push_back(
        "majority, soft, unanimous and Dawid-Skene rates differ by more than 3 points (evac rate status)");
  return resolved;
}

}  // namespace evac
