#include "apps/networks/judge_training.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/seed.h"
#include "worldmodel/train/option_limits.h"

namespace evac {
namespace {

enum Stream : std::uint32_t { kPick = 11, kChange = 12, kMove = 13 };

constexpr const char* kTraining = "judge training";

/// Rows of the pictures between first and last, each moved on its own.
std::vector<std::int64_t> JitteredRows(const PackedClip& clip, const JudgeTrainingOptions& options, train::Dice& dice) {
  std::vector<std::int64_t> rows;
  const double longer = options.longest > 1 ? std::pow(options.longest, dice.Uniform()) : 1, jitter = options.jitter;
  const double step = longer * static_cast<double>(clip.frames - 1) / static_cast<double>(kClassifierFrames - 1);
  for (std::int64_t i = 0; i < kClassifierFrames; ++i) {
    const bool is_inner = i > 0 && i + 1 < kClassifierFrames;
    const double at = (static_cast<double>(i) + (is_inner ? dice.Uniform(-jitter, jitter) : 0)) * step;
    rows.push_back(clip.first + std::clamp<std::int64_t>(std::llround(at), 0, clip.frames - 1));
  }
  return rows;
}

/// log(1 + e^x) - x y without overflow: the cross entropy of a logit and an outcome.
at::Tensor CrossEntropy(const at::Tensor& logit, const at::Tensor& outcome) {
  return (logit.clamp_min(0) - logit * outcome + (1 + (-logit.abs()).exp()).log()).mean();
}

at::Tensor Indices(const std::vector<std::int64_t>& rows) { return at::tensor(at::ArrayRef<std::int64_t>(rows)); }

/// Which of n rows is shown in each row when all move on by `shift`; the first or last is repeated.
at::Tensor ShiftedRows(std::int64_t n, std::int64_t shift) {
  return (at::arange(n, at::kLong) - shift).clamp(0, n - 1);
}

}  // namespace

SeenClip Moved(const SeenClip& clip, const std::vector<std::array<std::int64_t, 2>>& shift_px, bool is_mirrored) {
  const at::Tensor& bytes = clip.pictures;
  const std::int64_t height = bytes.size(2), width = bytes.size(3);
  std::vector<at::Tensor> pictures, objects;
  for (std::size_t v = 0; v < shift_px.size(); ++v) {
    const auto [right, down] = shift_px[v];
    const auto view = static_cast<std::int64_t>(v);
    pictures.push_back(
        bytes[view].index_select(1, ShiftedRows(height, down)).index_select(2, ShiftedRows(width, right)));
    objects.push_back(clip.objects[view] + at::tensor({static_cast<float>(right), static_cast<float>(down)}));
  }
  SeenClip moved{at::stack(pictures), at::stack(objects)};
  if (is_mirrored) {
    moved.pictures = moved.pictures.flip(3);
    moved.objects = moved.objects * at::tensor({-1.0F, 1.0F}) + at::tensor({static_cast<float>(width), 0.0F});
  }
  return moved;
}

train::Settings SettingsOf(JudgeTrainingOptions& options) {
  train::Settings settings = {{"batch", &options.batch},
                              {"calibration", &options.calibration},
                              {"drop_view", &options.drop_view},
                              {"jitter", &options.jitter},
                              {"longest", &options.longest},
                              {"looks", &options.looks},
                              {"object_weight", &options.object_weight},
                              {"reconstructed_share", &options.reconstructed_share},
                              {"shift_px", &options.shift_px},
                              {"mirror_share", &options.mirror_share},
                              {"unsure", &options.unsure},
                              {"light", &options.changes.light},
                              {"offset", &options.changes.offset},
                              {"blur_share", &options.changes.blur_share},
                              {"blur_times", &options.changes.blur_times}};
  const train::Settings shared = SettingsOf(options.job.trainer);
  settings.insert(settings.end(), shared.begin(), shared.end());
  return settings;
}

void CheckJudgeOptions(const JudgeTrainingOptions& options) {
  if (options.batch < 1) throw InvalidInput("judge training: batch is {}, wanted at least 1", options.batch);
  if (options.looks < 1 || options.looks > 16) throw InvalidInput("judge training: looks is {}, wanted 1 … 16", options.looks);
  if (!(options.longest >= 1)) throw InvalidInput("judge training: longest is {}, wanted at least 1", options.longest);
  train::RequireShares(kTraining, {{"calibration", options.calibration},
                                   {"drop_view", options.drop_view},
                                   {"jitter", options.jitter},
                                   {"mirror_share", options.mirror_share},
                                   {"reconstructed_share", options.reconstructed_share},
                                   {"unsure", options.unsure}});
  train::RequireWeights(kTraining, {{"object_weight", options.object_weight}});
  CheckChanges(kTraining, options.changes);
  if (options.shift_px < 0) throw InvalidInput("judge training: shift_px is {}, wanted at least 0", options.shift_px);
}

void RequireBothOutcomes(const JudgeClips& clips, const char* to) {
  const auto successes = std::ranges::count_if(clips, [](const PackedClip& clip) { return clip.outcome == 1; });
  if (successes == 0 || successes == std::ssize(clips))
    throw InvalidInput("{} of {} clips to {} are successes, wanted some of both kinds: more recordings", successes,
                       clips.size(), to);
}

JudgeSplit SplitForJudge(const JudgeClips& clips, const JudgeTrainingOptions& options) {
  const std::uint64_t seed = SeedFor(options.job.trainer.seed, "judge calibration");
  JudgeSplit split;
  for (const PackedClip& clip : clips) {
    const bool calibrates = SplitMix64(SeedFor(seed, clip.state)).Uniform() < options.calibration;
    if (!calibrates) split.fit.push_back(clip);
    if (calibrates && !clip.is_again) split.calibration.push_back(clip);
  }
  RequireBothOutcomes(split.fit, "learn from");
  RequireBothOutcomes(split.calibration, "calibrate with");
  return split;
}

std::vector<std::int64_t> RowsOf(const PackedClip& clip, double longer) {
  std::vector<std::int64_t> rows;
  const std::int64_t last = clip.frames - 1;
  const double step = longer * static_cast<double>(last) / static_cast<double>(kClassifierFrames - 1);
  for (std::int64_t i = 0; i < kClassifierFrames; ++i)
    rows.push_back(clip.first + std::min<std::int64_t>(last, std::llround(step * static_cast<double>(i))));
  return rows;
}

double MiddleLength(const JudgeTrainingOptions& options) { return (1 + options.longest) / 2; }

ClassifierClips ForNetwork(const at::Tensor& bytes, const JudgeClips& clips) {
  std::vector<std::int64_t> tasks;
  for (const PackedClip& clip : clips) tasks.push_back(clip.task);
  return {bytes.to(at::kFloat) / 127.5 - 1, at::ones({bytes.size(0), bytes.size(1)}), Indices(tasks)};
}

JudgeTraining::JudgeTraining(const JudgeClipSource& source, const JudgeClips& fit, const JudgeTrainingOptions& options)
    : source_(source), fit_(fit), options_(options) {
  CheckJudgeOptions(options);
}

std::vector<std::array<std::int64_t, 2>> JudgeTraining::DrawShifts(train::Dice& dice, std::int64_t views) const {
  std::vector<std::array<std::int64_t, 2>> shifts;
  const std::int64_t choices = 2 * options_.shift_px + 1;
  for (std::int64_t v = 0; v < views; ++v) {
    const std::int64_t right = dice.Below(choices) - options_.shift_px;
    shifts.push_back({right, dice.Below(choices) - options_.shift_px});
  }
  return shifts;
}

JudgeTraining::Batch JudgeTraining::Draw(const train::StepPlace& place) const {
  train::Dice pick(place, kPick), change(place, kChange), move(place, kMove);
  JudgeClips clips;
  std::vector<at::Tensor> pictures, objects;
  std::vector<float> successes;
  const auto views = static_cast<std::int64_t>(source_.cameras.size());
  at::Tensor present = at::ones({options_.batch, views});
  for (std::int64_t b = 0; b < options_.batch; ++b) {
    const PackedClip& clip = fit_[static_cast<std::size_t>(pick.Below(static_cast<std::int64_t>(fit_.size())))];
    const std::vector<std::int64_t> rows = JitteredRows(clip, options_, pick);
    if (pick.Chance(options_.drop_view)) present[b].narrow(0, 1, views - 1).zero_();
    const bool is_reconstructed = !source_.Codec().empty() && pick.Chance(options_.reconstructed_share);
    SeenClip seen{is_reconstructed ? source_.Reconstructed(clip, rows) : source_.Pictures(clip, rows),
                  source_.Objects(clip, rows)};
    const auto shifts = DrawShifts(move, views);
    seen = Moved(seen, shifts, move.Chance(options_.mirror_share));
    pictures.push_back(seen.pictures);
    objects.push_back(seen.objects);
    successes.push_back(clip.outcome == 1 ? 1.0F : 0.0F);
    clips.push_back(clip);
  }
  Batch batch{ForNetwork(at::stack(pictures), clips), at::tensor(at::ArrayRef<float>(successes)), {}, {}};
  batch.clips.pictures = Changed(batch.clips.pictures, options_.changes, change);
  batch.clips.present = present;
  const auto size = at::tensor({static_cast<float>(source_.width_px), static_cast<float>(source_.height_px)});
  const at::Tensor object = at::stack(objects) / size;                // [B, V, T, 2]
  const at::Tensor inside = ((object >= 0) * (object <= 1)).all(-1);  // false where it is not a number
  batch.visible = inside.to(at::kFloat) * present.unsqueeze(-1);
  batch.object = object.nan_to_num(0).clamp(0, 1);
  return batch;
}

at::Tensor JudgeTraining::Loss(const ClassifierNet& net, const train::StepPlace& place) const {
  const Batch batch = Draw(place);
  const ClassifierAnswer answer = net(batch.clips);
  const at::Tensor off = (answer.object - batch.object).abs().sum(-1) * batch.visible;
  return CrossEntropy(answer.logit, batch.success) + options_.object_weight * off.sum() / (batch.visible.sum() + 1e-6);
}

}  // namespace evac
