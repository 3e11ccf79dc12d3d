#include "apps/train_judge.h"

#include <fmt/format.h>

#include "apps/judge_quality.h"
#include "apps/learners.h"
#include "core/error.h"

namespace evac {
namespace {

/// What is written at the end, beside the weights.
struct Judged {
  ClassifierCard card;
  MeasuredJudge whole, masked, first_view;
  std::optional<MeasuredJudge> reconstructed;  ///< where there is a codec
};

/// What is learned from, calibrated with and measured on.
struct JudgeData {
  JudgeData(const std::filesystem::path& shards, const JudgeOptions& options, const JudgeCodec* codec)
      : set(shards, train::Split::kTrain),
        holdout(shards, train::Split::kHoldout),
        split(SplitForJudge(set, options)),
        unseen(Labelled(holdout)) {
    if (!codec) return;
    codec->Open(set.shards);
    codec->Open(holdout.shards);
  }

  PackedSet set, holdout;
  JudgeSplit split;   ///< of `set`
  JudgeClips unseen;  ///< of `holdout`
};

Judged MeasureAll(const ClassifierNet& net, const JudgeData& data, const JudgeOptions& options,
                  const JudgeCodec* codec) {
  Judged judged;
  judged.card = Calibrate(Logits(net, data.set, data.split.calibration, {}), data.split.calibration, options.unsure);
  const auto measure = [&](const JudgeLook& look) {
    return Measure(Logits(net, data.holdout, data.unseen, look), data.unseen, judged.card);
  };
  judged.whole = measure({});
  judged.masked = measure({.masks_object = true});
  judged.first_view = measure({.first_view_only = true});
  if (codec) judged.reconstructed = measure({.codec = codec});
  return judged;
}

void Say(const train::JobPlace& place, const ClassifierNet& net, const JudgeData& data, const Judged& judged) {
  if (!place.say) return;
  place.say("hold-out: " + judged.whole.Line());
  place.say("  object masked: " + judged.masked.Line());
  place.say("  first view alone: " + judged.first_view.Line());
  if (judged.reconstructed) place.say("  as the codec gives the pictures back: " + judged.reconstructed->Line());
  const std::vector<double> logits = Logits(net, data.holdout, data.unseen, {});
  place.say("  failures taken for successes: " + MistakesByFate(logits, data.unseen, judged.card));
}

TensorMetadata CardText(const Judged& judged, const PackedSet& set, const JudgeOptions& options, std::int64_t steps) {
  const auto number = [](double value) { return fmt::format("{:.6g}", value); };
  TensorMetadata card = {{"format", "evac-classifier 1"},
          {"tasks", Joined(set.tasks)},
          {"cameras", Joined(set.cameras)},
          {"frames", std::to_string(kClassifierFrames)},
          {"height_px", std::to_string(set.shards.height_px())},
          {"width_px", std::to_string(set.shards.width_px())},
          {"temperature", number(judged.card.temperature)},
          {"threshold", number(judged.card.threshold)},
          {"unsure", number(judged.card.unsure)},
          {"recipe", set.shards.metadata().at("recipe")},
          {"seed", std::to_string(options.job.trainer.seed)},
          {"steps", std::to_string(steps)},
          {"holdout_clips", std::to_string(judged.whole.clips)},
          {"auroc", number(judged.whole.auroc)},
          {"kappa", number(judged.whole.kappa)},
          {"ece", number(judged.whole.ece)},
          {"kappa_masked", number(judged.masked.kappa)},
          {"kappa_first_view", number(judged.first_view.kappa)},
          {"licence", "as the project"}};
  if (judged.reconstructed) {
    card["codec"] = set.shards.codec();
    card["kappa_reconstructed"] = number(judged.reconstructed->kappa);
  }
  return card;
}

}  // namespace

train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeOptions& given, const JudgeCodec* codec) {
  JudgeOptions options = given;
  const JudgeData data(place.shards, options, codec);
  const train::ShardSet& shards = data.set.shards;
  const ClassifierShape shape{data.set.tasks, data.set.cameras, static_cast<int>(shards.height_px()),
                              static_cast<int>(shards.width_px())};
  const Learners<ClassifierNet> learners(shape, options.job.trainer.seed, Workers(place, options.job));
  const ClassifierNet& net = learners.net();
  const JudgeTraining training(data.set, data.split.fit, options, codec);
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + shards.metadata().at("recipe") + shards.codec() +
                                 " workers " + std::to_string(learners.count());
  train::Trainer trainer(learners.weights().all(), options.job.trainer, place.out);
  const auto loss = [&](const ClassifierNet& of, const train::StepPlace& at) { return training.Loss(of, at); };
  learners.Replicate(trainer, loss);
  const JudgeClips& calibration = data.split.calibration;
  const train::TrainerSummary summary =
      trainer.Run({.loss = [&](const train::StepPlace& at) { return loss(net, at); },
                   .holdout = [&] { return LogLoss(Logits(net, data.set, calibration, {}), calibration); },
                   .interrupted = place.interrupted,
                   .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    const Judged judged = MeasureAll(net, data, options, codec);
    Say(place, net, data, judged);
    learners.Write(place.out / "judge.safetensors", CardText(judged, data.set, options, summary.step));
  });
  return summary;
}

}  // namespace evac
