#include "apps/networks/fidelity_judge.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "apps/judge_with_progress.h"
#include "apps/networks/painted_over.h"
#include "core/file.h"
#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/roc.h"
#include "core/video.h"
#include "judges/classifier_clip.h"
#include "judges/classifier_judge.h"
#include "judges/classifier_net.h"
#include "policies/visual_things.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kCovered = 0.15;  ///< share of a pixel that shows the object, from which it is painted over
constexpr const char* kPainted = "clip.mp4";

cv::Mat WithoutObject(const cv::Mat& frame, const ColourModel& colour) {
  cv::Mat mask = Cover(frame, colour) > kCovered;
  cv::dilate(mask, mask, cv::Mat::ones(5, 5, CV_8U));
  return PaintedOver(frame, mask);
}

/// A clip of the pictures that the judge would look at, with the object painted over.
void WriteWithoutObject(const fs::path& from, const ColourModel& colour, const fs::path& to) {
  VideoWriter writer(to, {.period_s = 0.1, .crf = 10, .preset = "veryfast", .scale = 1});
  VideoReader reader(from);
  cv::Mat painted;
  int at = 0;
  for (const int row : EvenlySpaced(reader.frames(), static_cast<int>(kClassifierFrames))) {
    for (; at < row; ++at) reader.Skip();
    if (at == row) painted = WithoutObject(reader.Next(), colour), ++at;
    writer.Append(painted);
  }
  writer.Finish();
}

/// The classifier, shown clips with the object painted over. Its verdicts are stored as a judge's of their own, as those
/// of every probe: "NAME:masked".
class MaskedClassifier : public Judge {
 public:
  /// @param run      the folder of the clips
  /// @param scratch  a folder for one painted clip
  MaskedClassifier(const std::string& weights, fs::path run, const fs::path& scratch)
      : judge_(weights, scratch), run_(std::move(run)), painted_(scratch / kPainted) {}

  std::string Name() const override { return judge_.Name() + ":masked"; }

  Verdict Rate(const Task& task, const Episode& episode) override {
    WriteWithoutObject(run_ / episode.video, KnowledgeOf(task.id).thing.colour, painted_);
    Episode masked = episode;
    masked.video = painted_.filename();
    Verdict verdict = judge_.Rate(task, masked);
    verdict.judge = Name();
    return verdict;
  }

 private:
  ClassifierJudge judge_;
  fs::path run_, painted_;
};

/// The painted clip, what a killed process left of one, and their folder if nothing of somebody's is in it.
void RemovePainted(const fs::path& scratch) {
  std::error_code left;
  fs::remove(scratch / kPainted, left);
  fs::remove(scratch / (std::string(kPainted) + ".tmp"), left);
  if (!fs::is_symlink(scratch)) fs::remove(scratch, left);
}

std::optional<bool> OutcomeOf(Label label) {
  if (label == Label::kSuccess) return true;
  if (label == Label::kFailure) return false;
  return std::nullopt;
}

/// What a judge said of one episode; nothing if it was not asked.
std::optional<bool> SaidBy(const std::string& judge, const std::map<std::string, Verdict>& of_episode) {
  const auto found = of_episode.find(judge);
  return found == of_episode.end() ? std::nullopt : OutcomeOf(found->second.label);
}

}  // namespace

void FidelityJudge::RequireKnows(const std::vector<Task>& tasks) const {
  if (!classifier_.empty()) ClassifierJudge(classifier_, "").CheckKnows(tasks);
}

void FidelityJudge::Rate(Store& store) {
  if (classifier_.empty()) return;
  ClassifierJudge judge(classifier_, store.folder());
  JudgeWithProgress(judge, store, {});
  name_ = judge.Name();
}

JudgeQualityOnReal FidelityJudge::QualityOn(Store& store, const std::string& world, const fs::path& scratch) {
  JudgeQualityOnReal quality;
  quality.name = name_;
  if (name_.empty()) return quality;
  MakeFolders(scratch);
  MaskedClassifier masked_judge(classifier_, store.folder(), scratch);
  const auto told = store.CurrentVerdicts();
  const auto is_told = [&](const Episode& episode) {  // what it cannot be asked about whole (too long) is not asked about
    return episode.key.world == world && told.contains(episode.key.Id()) && told.at(episode.key.Id()).contains(name_) &&
           told.at(episode.key.Id()).at(name_).probability.has_value();
  };
  const auto can_be_painted = [&](const Episode& episode) {
    return is_told(episode) && HasKnowledgeOf(episode.key.pair.task);
  };
  JudgeWithProgress(masked_judge, store, {.wanted = can_be_painted});
  RemovePainted(scratch);

  std::vector<double> probabilities;
  std::vector<int> truths;
  ConfusionByState plain, masked;
  const auto count = [](std::optional<bool> said, bool truth, const PairKey& pair, ConfusionByState& states) {
    if (said) states[{pair.task, pair.initial_state}].Add(*said, truth);
  };
  const auto verdicts = store.CurrentVerdicts();
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop) || !is_told(episode)) continue;
    const auto& of_episode = verdicts.at(episode.key.Id());
    const auto truth = SaidBy("oracle", of_episode);
    if (!truth) continue;
    const Verdict& said = of_episode.at(name_);
    probabilities.push_back(*said.probability);
    truths.push_back(*truth);
    count(OutcomeOf(said.label), *truth, episode.key.pair, plain);
    count(SaidBy(masked_judge.Name(), of_episode), *truth, episode.key.pair, masked);
  }
  quality.auroc = AreaUnderRoc(probabilities, truths);
  quality.ece = CalibrationOf(probabilities, truths).ece;
  quality.kappa = StatisticsByState(plain).kappa;
  quality.kappa_masked = Undefined{"no clip of a task whose object's colour is known"};
  if (!masked.empty()) quality.kappa_masked = StatisticsByState(masked).kappa.value;
  return quality;
}

OutcomesOf::OutcomesOf(const Store& store, std::string judge)
    : judge_(std::move(judge)), folder_(store.folder().filename().string()), verdicts_(store.CurrentVerdicts()) {
  for (const Episode& episode : store.Episodes()) {
    if (!IsFailure(episode.stop)) clips_[episode.key.Id()] = episode.video;
  }
}

std::string OutcomesOf::Clip(const EpisodeKey& key) const {
  const auto found = clips_.find(key.Id());
  return found == clips_.end() ? "" : folder_ + "/" + found->second;
}

std::optional<bool> OutcomesOf::By(const std::string& judge, const EpisodeKey& key) const {
  if (!clips_.contains(key.Id())) return std::nullopt;
  const auto episode = verdicts_.find(key.Id());
  return episode == verdicts_.end() ? std::nullopt : SaidBy(judge, episode->second);
}

}  // namespace evac
