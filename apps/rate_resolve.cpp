#include "apps/rate_resolve.h"

#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "core/store.h"
#include "judges/rating_tally.h"

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
    for (const auto& stage : document.at("stages")) of_rubric.stages.push_back(stage.value("name", ""));
  }
  return facts;
}

void CheckRubrics(const std::vector<RatedClip>& clips) {
  std::map<std::string, std::set<std::string>> by_task;
  for (const RatedClip& clip : clips) {
    if (!clip.by_rater.empty()) by_task[clip.clip.task].insert(clip.clip.rubric_hash);
  }
  for (const auto& [task, hashes] : by_task) {
    if (hashes.size() > 1)
      throw InvalidInput("task {}: was rated by {} rubrics; --mix-rubrics makes one judge of them", task,
                         hashes.size());
  }
}

/// A stage counts as reached if more than half of the votes say so.
std::map<std::string, bool> StagesOf(const RatedClip& clip, const RubricFacts& facts) {
  std::map<std::string, bool> stages;
  if (clip.by_rater.empty()) return stages;
  for (std::size_t k = 0; k < facts.stages.size(); ++k) {
    std::size_t reached = 0;
    for (const auto& [rater, ballot] : clip.by_rater) reached += ballot.stages >> k & 1;
    stages[facts.stages[k]] = 2 * reached > clip.by_rater.size();
  }
  return stages;
}

std::string ReasonOf(const RatedClip& clip) {
  const Majority& majority = clip.resolution.majority;
  return fmt::format("{}: {} success, {} failure, {} cannot tell", clip.resolution.how, majority.successes,
                     majority.valid - majority.successes, majority.unsure);
}

std::vector<Verdict> VerdictsOf(const RatedClip& clip, const RubricFacts& facts, const std::string& study,
                                const ResolveOptions& options) {
  std::vector<Verdict> verdicts;
  Verdict verdict;
  verdict.episode_id = clip.clip.episode;
  verdict.judge = options.judge;
  verdict.label = clip.resolution.label.value_or(Label::kCannotTell);
  if (clip.resolution.majority.soft) verdict.probability = *clip.resolution.majority.soft;
  verdict.stages = StagesOf(clip, facts);
  verdict.reason = ReasonOf(clip);
  verdict.rubric_version = facts.version;
  verdicts.push_back(verdict);
  for (const auto& [rater, ballot] : clip.by_rater) {
    if (!options.each_rater) break;
    verdict.judge = fmt::format("human:{}:r{}", study, rater);
    verdict.label = LabelFromName(ballot.label);
    verdict.probability = std::nullopt;
    for (std::size_t k = 0; k < facts.stages.size(); ++k)
      verdict.stages[facts.stages[k]] = (ballot.stages >> k & 1) != 0;
    verdict.reason = "";
    verdicts.push_back(verdict);
  }
  return verdicts;
}

bool IsSame(const Verdict& a, const Verdict& b) {
  return a.label == b.label && a.reason == b.reason && a.stages == b.stages && a.rubric_version == b.rubric_version;
}

/// Adds what a run does not say yet.
std::int64_t WriteTo(const std::string& run, const std::vector<Verdict>& verdicts) {
  Store store = Store::Open(run, Store::Mode::kReadWrite);
  const auto current = store.CurrentVerdicts();
  std::vector<Verdict> wanted;
  for (const Verdict& verdict : verdicts) {
    const auto of_episode = current.find(verdict.episode_id);
    const bool is_known = of_episode != current.end() && of_episode->second.contains(verdict.judge);
    if (!is_known || !IsSame(of_episode->second.at(verdict.judge), verdict)) wanted.push_back(verdict);
  }
  store.AddVerdicts(wanted);
  return static_cast<std::int64_t>(wanted.size());
}

}  // namespace

Resolved ResolveStudy(const StudyStore& study, const ResolveOptions& options) {
  RatingTally tally;
  tally.Read(study);
  const std::vector<RatedClip>& clips = tally.rated();
  if (!options.mix_rubrics) CheckRubrics(clips);
  const auto facts = FactsOf(study);
  const std::string name = study.info().name;
  Resolved resolved;
  std::map<std::string, std::vector<Verdict>> by_run;
  for (const RatedClip& clip : clips) {
    if (clip.by_rater.empty()) continue;
    ++(clip.resolution.label ? resolved.decided : resolved.undecided);
    for (Verdict& verdict : VerdictsOf(clip, facts.at(clip.clip.rubric_hash), name, options))
      by_run[clip.clip.run].push_back(std::move(verdict));
  }
  for (const auto& [run, verdicts] : by_run) resolved.written += WriteTo(run, verdicts);
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
