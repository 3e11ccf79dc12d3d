#include "worldmodel/train/train_forecast.h"

#include <cstdio>
#include <deque>

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/train_world.h"

namespace evac::train {
namespace {

std::string Text(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// One copy of the network that is trained, and its loss.
struct ForecastWorker {
  ForecastWorker(nn::ParameterSource& source, const ShardSet& shards, const nn::ModelConfig& config,
                 const ForecastOptions& options)
      : weights(source), forecast(nn::Scope(weights, nn::kForecastPrefix), config),
        training(shards, config, options.forecast) {}
  Tensor Loss(const StepPlace& at) const { return training.Loss(forecast, at); }

  TrainableWeights weights;
  nn::ObjectForecast forecast;
  ForecastTraining training;
};

}  // namespace

TrainerSummary TrainForecast(const JobPlace& place, const ForecastOptions& given) {
  CheckOptions(given.job.trainer);
  ForecastOptions options = given;
  if (!place.config.object_forecast)
    throw TensorError("the page of sizes has object_forecast: false, wanted true");
  ShardSet shards(place.shards, Split::kTrain);
  shards.OpenVariants();
  const ShardSet holdout(EachOnce(place.shards), Split::kHoldout);
  CheckPictures(shards, place.config);
  CheckPoseMaps(shards, place.config);  // with them the page says how long the tool is
  shards.CheckLike(holdout);
  nn::RandomWeights random(options.job.trainer.seed);
  std::deque<ForecastWorker> workers;
  for (std::int64_t i = 0; i < Workers(place, options.job); ++i)
    workers.emplace_back(random, shards, place.config, options);
  const TrainableWeights& weights = workers.front().weights;
  const ForecastTraining measuring(holdout, place.config, options.forecast);
  options.job.trainer.identity =
      IdentityOf(SettingsOf(options)) + shards.metadata().at("recipe") + IdentityOf(place, options.job) +
      (shards.variants().empty() ? "" : " variants " + std::to_string(shards.variants().size()) + " " +
                                            std::to_string(shards.variants_hash()));
  if (place.say && !shards.variants().empty())
    place.say(std::to_string(shards.variants().size()) + " variants beside " + std::to_string(shards.clips().size()) + " clips");
  Trainer trainer(weights.all(), options.job.trainer, place.out);
  for (std::size_t i = 1; i < workers.size(); ++i)
    trainer.AddReplica(
        {workers[i].weights.all(), [&worker = workers[i]](const StepPlace& at) { return worker.Loss(at); }});
  const auto measure = [&] {
    const ForecastQuality quality = measuring.Measure(workers.front().forecast);
    if (place.say)
      place.say("hold-out: " + Text("%.3f", quality.agreement) + " of " + std::to_string(quality.told) +
                " outcomes told, found in the first picture within " + Text("%.2f", quality.finder_px) + " px");
    return quality;
  };
  const TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& at) { return workers.front().Loss(at); },
                                              .holdout = [&] { return measure().loss; },
                                              .interrupted = place.interrupted,
                                              .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    const ForecastQuality quality = measure();
    std::vector<TensorView> views;
    for (const NamedTensor& weight : weights.all()) views.push_back(nn::ViewOf(weight.name, weight.tensor.detach()));
    TensorMetadata card = {{"format", "pt"},
                           {"seed", std::to_string(options.job.trainer.seed)},
                           {"recipe", shards.metadata().at("recipe")},
                           {"agreement", Text("%.3f", quality.agreement)},
                           {"finder_px", Text("%.2f", quality.finder_px)}};
    card.merge(summary.CardOfSteps());
    card.merge(WhatForecastIsFor(shards.metadata(), place.config));
    WriteTensorFile(place.out / "forecast.safetensors", views, card);
  });
  return summary;
}

}  // namespace evac::train
