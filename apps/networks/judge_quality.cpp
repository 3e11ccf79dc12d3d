#include "apps/networks/judge_quality.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/roc.h"
#include "core/statistics/threshold.h"

namespace evac {
namespace {

constexpr std::size_t kBatch = 32;
constexpr int kGrey = 128;

/// Covers what lies within the radius of the object's middle. @param pictures  [V, T, H, W, 3] bytes, changed
/// @param objects  [V, T, 2] pixels; where it is not a number nothing is covered
void MaskObject(const at::Tensor& objects, double radius, const at::Tensor& pictures) {
  const std::int64_t height = pictures.size(2), width = pictures.size(3);
  const at::Tensor x = at::arange(width, at::kFloat) + 0.5, y = at::arange(height, at::kFloat) + 0.5;
  const double radius_px = radius * static_cast<double>(height);
  for (std::int64_t v = 0; v < pictures.size(0); ++v) {
    for (std::int64_t t = 0; t < pictures.size(1); ++t) {
      const at::Tensor middle = objects[v][t];
      const at::Tensor dx = x - middle[0], dy = y - middle[1];
      const at::Tensor disc = (dx * dx).unsqueeze(0) + (dy * dy).unsqueeze(1) < radius_px * radius_px;
      pictures[v][t].masked_fill_(disc.unsqueeze(-1), kGrey);
    }
  }
}

double KappaAt(const std::vector<double>& probabilities, const std::vector<int>& outcomes, double threshold) {
  const Number kappa = StatisticsOf(ConfusionAt(probabilities, outcomes, threshold)).kappa.value;
  return kappa ? *kappa : std::numeric_limits<double>::quiet_NaN();
}

std::vector<double> Probabilities(const std::vector<double>& logits, const ClassifierCard& card) {
  std::vector<double> probabilities;
  for (const double logit : logits) probabilities.push_back(CalibratedProbability(logit, card));
  return probabilities;
}

std::vector<int> Outcomes(const JudgeClips& clips) {
  std::vector<int> outcomes;
  for (const PackedClip& clip : clips) outcomes.push_back(clip.outcome);
  return outcomes;
}

double OrNotANumber(const Number& number) { return number ? *number : std::numeric_limits<double>::quiet_NaN(); }

}  // namespace

std::vector<double> Logits(const ClassifierNet& net, const JudgeClipSource& source, const JudgeClips& clips,
                           const JudgeLook& look, const std::function<void()>& on_clip) {
  const at::NoGradGuard no_gradients;
  std::vector<double> logits;
  for (std::size_t begin = 0; begin < clips.size(); begin += kBatch) {
    const JudgeClips some(clips.begin() + static_cast<std::ptrdiff_t>(begin),
                          clips.begin() + static_cast<std::ptrdiff_t>(std::min(begin + kBatch, clips.size())));
    std::vector<at::Tensor> pictures;
    for (const PackedClip& clip : some) {
      const std::vector<std::int64_t> rows = RowsOf(clip, look.longer);
      pictures.push_back(look.reconstructed ? source.Reconstructed(clip, rows) : source.Pictures(clip, rows).clone());
      if (look.masks_object) MaskObject(source.Objects(clip, rows), look.mask_radius, pictures.back());
    }
    ClassifierClips seen = ForNetwork(at::stack(pictures), some);
    if (look.first_view_only) seen.present.narrow(1, 1, seen.present.size(1) - 1).zero_();
    const at::Tensor answers = net(seen).logit.to(at::kDouble).contiguous();
    logits.insert(logits.end(), answers.data_ptr<double>(), answers.data_ptr<double>() + answers.numel());
    for (std::size_t i = 0; on_clip && i < some.size(); ++i) on_clip();
  }
  return logits;
}

double CalibratedProbability(double logit, const ClassifierCard& card) {
  return 1 / (1 + std::exp((card.offset - logit) / card.temperature));
}

double LogLoss(const std::vector<double>& logits, const JudgeClips& clips) {
  return OrNotANumber(CalibrationOf(Probabilities(logits, {}), Outcomes(clips)).log_loss);
}

ClassifierCard Calibrate(const std::vector<double>& logits, const JudgeClips& clips, double unsure) {
  const std::vector<int> outcomes = Outcomes(clips);
  ClassifierCard card;
  card.unsure = unsure;
  double best_loss = std::numeric_limits<double>::infinity();
  for (double temperature = 0.2; temperature < 20; temperature *= 1.02) {
    const double loss = OrNotANumber(CalibrationOf(Probabilities(logits, {temperature, 0.5, 0}), outcomes).log_loss);
    if (!(loss < best_loss)) continue;
    best_loss = loss;
    card.temperature = temperature;
  }
  if (const Number threshold = BalancedThreshold(Probabilities(logits, card), outcomes)) card.threshold = *threshold;
  return card;
}

std::string MeasuredJudge::Line() const {
  return fmt::format("AUROC {:.4f}, kappa {:.3f}, ECE {:.3f}, cannot tell {:.1f} % of {} clips", auroc, kappa, ece,
                     100 * cannot_tell, clips);
}

MeasuredJudge Measure(const std::vector<double>& logits, const JudgeClips& clips, const ClassifierCard& card) {
  const std::vector<double> probabilities = Probabilities(logits, card);
  const std::vector<int> outcomes = Outcomes(clips);
  const auto unsure = std::count_if(probabilities.begin(), probabilities.end(),
                                    [&](double p) { return LabelOf(p, card) == Label::kCannotTell; });
  return {OrNotANumber(AreaUnderRoc(logits, outcomes)), KappaAt(probabilities, outcomes, card.threshold),
          OrNotANumber(CalibrationOf(probabilities, outcomes).ece),
          clips.empty() ? 0 : static_cast<double>(unsure) / static_cast<double>(clips.size()), clips.size()};
}

std::string MistakesByFate(const std::vector<double>& logits, const JudgeClips& clips, const ClassifierCard& card) {
  std::map<std::string, std::pair<int, int>> fates;  // mistaken, in all
  for (std::size_t i = 0; i < clips.size(); ++i) {
    if (clips[i].outcome == 1) continue;
    auto& [mistaken, all] = fates[clips[i].fate];
    mistaken += CalibratedProbability(logits[i], card) >= card.threshold;
    ++all;
  }
  std::string text;
  for (const auto& [fate, counts] : fates)
    text += fmt::format("{}{} {}/{}", text.empty() ? "" : ", ", fate, counts.first, counts.second);
  return text;
}

}  // namespace evac
