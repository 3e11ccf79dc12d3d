#include "apps/networks/judge_tables.h"

#include <fmt/format.h>

#include "apps/networks/judge_quality.h"
#include "core/statistics/threshold.h"
#include "reports/csv.h"

namespace evac {
namespace {

constexpr int kThresholds = 19, kThresholdsPerOne = 20;

}  // namespace

std::string JudgedCsv(const std::vector<JudgedClips>& judged, const ClassifierCard& card,
                      const std::vector<std::string>& tasks) {
  std::string csv = "part,seen,task,recording,state,behaviour,fate,outcome,probability,verdict\n";
  for (const JudgedClips& some : judged) {
    for (std::size_t i = 0; i < some.clips->size(); ++i) {
      const PackedClip& clip = (*some.clips)[i];
      const double probability = CalibratedProbability(some.logits[i], card);
      csv += CsvLine({some.part, some.seen, tasks.at(static_cast<std::size_t>(clip.task)),
                      clip.episode.empty() ? std::to_string(clip.recording) : clip.episode, clip.state, clip.behaviour,
                      clip.fate, std::to_string(clip.outcome), fmt::format("{:.4f}", probability),
                      Name(LabelOf(probability, card))});
    }
  }
  return csv;
}

std::string ThresholdsCsv(const std::vector<JudgedClips>& judged, const ClassifierCard& card) {
  std::string csv = "part,seen,threshold,failures,called_successes,successes,called_failures,agreement\n";
  for (const JudgedClips& some : judged) {
    std::vector<double> probabilities;
    std::vector<int> outcomes;
    for (std::size_t i = 0; i < some.clips->size(); ++i) {
      probabilities.push_back(CalibratedProbability(some.logits[i], card));
      outcomes.push_back((*some.clips)[i].outcome == 1 ? 1 : 0);
    }
    for (int step = 1; step <= kThresholds; ++step) {
      const double threshold = static_cast<double>(step) / kThresholdsPerOne;
      const Confusion c = ConfusionAt(probabilities, outcomes, threshold);
      const Number agreement = StatisticsOf(c).accuracy;
      csv += fmt::format("{},{},{:.2f},{},{},{},{},{}\n", some.part, some.seen, threshold, c.only_judge_success + c.both_failure,
                         c.only_judge_success, c.both_success + c.only_human_success, c.only_human_success,
                         agreement ? fmt::format("{:.4f}", *agreement) : "");
    }
  }
  return csv;
}

}  // namespace evac
