#include "apps/train_judge.h"

#include <fmt/format.h>

#include <deque>

#include "apps/judge_quality.h"
#include "apps/relu_weights.h"
#include "core/error.h"
#include "core/statistics/confusion.h"

namespace evac {
namespace {

/// One copy of the network that is trained.
struct JudgeWorker {
  JudgeWorker(const ClassifierShape& shape, const JudgeOptions& options)
      : random(options.job.trainer.seed),
        weights(random),
        net(shape, [this](const std::string& key, const std::vector<std::int64_t>& sizes) {
          return weights.Take(key, sizes);
        }) {}
  JudgeWorker(const JudgeWorker&) = delete;
  JudgeWorker& operator=(const JudgeWorker&) = delete;

  ReluWeights random;
  train::TrainableWeights weights;
  ClassifierNet net;
};

/// What is written at the end, beside the weights.
struct Judged {
  ClassifierCard card;
  MeasuredJudge whole, masked, first_view;
};

/// What is learned from, calibrated with and measured on.
struct JudgeData {
  JudgeData(const std::filesystem::path& shards, const JudgeOptions& options)
      : set(shards, train::Split::kTrain),
        holdout(shards, train::Split::kHoldout),
        split(SplitForJudge(set, options)),
        unseen(Labelled(holdout)) {}

  PackedSet set, holdout;
  JudgeSplit split;   ///< of `set`
  JudgeClips unseen;  ///< of `holdout`
};

Judged MeasureAll(const ClassifierNet& net, const JudgeData& data, const JudgeOptions& options) {
  Judged judged;
  judged.card = Calibrate(Logits(net, data.set, data.split.calibration, {}), data.split.calibration, options.unsure);
  const auto measure = [&](const JudgeLook& look) {
    return Measure(Logits(net, data.holdout, data.unseen, look), data.unseen, judged.card);
  };
  judged.whole = measure({});
  judged.masked = measure({.masks_object = true});
  judged.first_view = measure({.first_view_only = true});
  return judged;
}

void Say(const train::JobPlace& place, const ClassifierNet& net, const JudgeData& data, const Judged& judged) {
  if (!place.say) return;
  place.say("hold-out: " + judged.whole.Line());
  place.say("  object masked: " + judged.masked.Line());
  place.say("  first view alone: " + judged.first_view.Line());
  const std::vector<double> logits = Logits(net, data.holdout, data.unseen, {});
  place.say("  failures taken for successes: " + MistakesByFate(logits, data.unseen, judged.card));
}

TensorMetadata CardText(const Judged& judged, const PackedSet& set, const JudgeOptions& options, std::int64_t steps) {
  const auto number = [](double value) { return fmt::format("{:.6g}", value); };
  return {{"format", "evac-classifier 1"},
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
}

void Write(const std::filesystem::path& path, const train::TrainableWeights& weights, const TensorMetadata& card) {
  std::vector<TensorView> views;
  for (const train::NamedTensor& weight : weights.all())
    views.push_back(nn::ViewOf(weight.name, weight.tensor.detach()));
  WriteTensorFile(path, views, card);
}

}  // namespace

train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeOptions& given) {
  JudgeOptions options = given;
  const JudgeData data(place.shards, options);
  const train::ShardSet& shards = data.set.shards;
  const ClassifierShape shape{data.set.tasks, data.set.cameras, static_cast<int>(shards.height_px()),
                              static_cast<int>(shards.width_px())};
  std::deque<JudgeWorker> workers;
  for (std::int64_t i = 0; i < Workers(place, options.job); ++i) workers.emplace_back(shape, options);
  const ClassifierNet& net = workers.front().net;
  const JudgeTraining training(data.set, data.split.fit, options);
  options.job.trainer.identity =
      IdentityOf(SettingsOf(options)) + shards.metadata().at("recipe") + " workers " + std::to_string(workers.size());
  train::Trainer trainer(workers.front().weights.all(), options.job.trainer, place.out);
  for (std::size_t i = 1; i < workers.size(); ++i)
    trainer.AddReplica(
        {workers[i].weights.all(), [&, i](const train::StepPlace& at) { return training.Loss(workers[i].net, at); }});
  const JudgeClips& calibration = data.split.calibration;
  const train::TrainerSummary summary =
      trainer.Run({.loss = [&](const train::StepPlace& at) { return training.Loss(net, at); },
                   .holdout = [&] { return LogLoss(Logits(net, data.set, calibration, {}), calibration); },
                   .interrupted = place.interrupted,
                   .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    const Judged judged = MeasureAll(net, data, options);
    Say(place, net, data, judged);
    Write(place.out / "judge.safetensors", workers.front().weights, CardText(judged, data.set, options, summary.step));
  });
  return summary;
}

}  // namespace evac
